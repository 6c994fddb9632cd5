// Cuts, fusion and tracking over the frames of a video: lime_keras/video/{cuts,fusion,tracking}.py.

const WINDOW = 5;
const LOST_AFTER = 30;
const CUT = 0.25;
const STANDS_OUT = 2;
const BINS = 16;
const ACROSS = 64;

/** The fusion of an array of numbers: a median of five frames, then their mean. NaN is not seen. */
export class Fusion {
  constructor() {
    this.restart();
  }

  restart() {
    this.recent = null;
  }

  /** Fuse the next frame's estimate, of the same length until a restart; return the fused one. */
  update(estimate) {
    const count = estimate.length;
    if (this.recent === null) {
      this.recent = Array.from({ length: WINDOW }, () => new Float64Array(count).fill(NaN));
      this.sightings = new Float64Array(count);
      this.average = new Float64Array(count).fill(NaN);
    }
    for (let at = 0; at < count; at++) {
      if (Number.isNaN(estimate[at])) continue;
      for (let frame = WINDOW - 1; frame > 0; frame--) {
        this.recent[frame][at] = this.recent[frame - 1][at];
      }
      this.recent[0][at] = estimate[at];
      const seen = ++this.sightings[at];
      const before = seen === 1 ? 0 : this.average[at];
      this.average[at] = before + (this.median(at, Math.min(seen, WINDOW)) - before) / seen;
    }
    return this.average.slice();
  }

  median(at, count) {
    const ordered = [];
    for (let frame = 0; frame < count; frame++) ordered.push(this.recent[frame][at]);
    ordered.sort((one, other) => one - other);
    return 0.5 * ordered[(count - 1) >> 1] + 0.5 * ordered[count >> 1];
  }
}

/** A detector of scene cuts, fed with every frame, an ImageData. */
export class CutDetector {
  constructor() {
    this.last = null;
    this.before = 0;
  }

  isCut(image) {
    const last = this.last;
    this.last = histogram(image);
    const before = this.before;
    this.before = last === null ? 0 : distance(last, this.last);
    return this.before > Math.max(CUT, STANDS_OUT * before);
  }
}

/** The colour histogram, 3 × 16, of an image; each channel's sum is 1. */
export function histogram({ data, width, height }) {
  const down = Math.max(1, Math.floor(height / ACROSS));
  const across = Math.max(1, Math.floor(width / ACROSS));
  const counts = new Float64Array(3 * BINS);
  let pixels = 0;
  for (let row = 0; row < height; row += down) {
    for (let column = 0; column < width; column += across) {
      pixels++;
      const from = 4 * (row * width + column);
      for (let channel = 0; channel < 3; channel++) {
        const position = data[from + channel] * ((BINS - 1) / 255);
        const lower = Math.min(Math.floor(position), BINS - 2);
        counts[channel * BINS + lower] += 1 - (position - lower);
        counts[channel * BINS + lower + 1] += position - lower;
      }
    }
  }
  return counts.map((count) => count / pixels);
}

function distance(one, other) {
  const shares = [0, 0, 0];
  one.forEach((value, at) => {
    shares[Math.floor(at / BINS)] += Math.abs(value - other[at]) / 2;
  });
  return Math.max(...shares);
}

/** A tracker of one object's material, [r, g, b, m_s, log10 s], through the frames of a video. */
export class Tracker {
  constructor() {
    this.cuts = new CutDetector();
    this.fusion = new Fusion();
    this.lost = 0;
  }

  /**
   * Add the next frame, an ImageData, and its estimate, NaN where nothing was estimated. The fusion
   * restarts after a cut, and after more than 30 frames in a row without an object.
   *
   * @returns {cut, fused}: `fused` is NaN where nothing has been seen.
   */
  step(image, found, estimate) {
    const cut = this.cuts.isCut(image);
    this.lost = found ? 0 : this.lost + 1;
    if (cut || this.lost > LOST_AFTER) this.fusion.restart();
    return { cut, fused: this.fusion.update(estimate) };
  }
}
