// The reasons to distrust an estimate: lime_keras/estimate/cautions.py, which says how the limits
// were chosen. The words for them are the page's (../warnings.js).

import { LINEAR } from "../colour.js";
import { roundHalfEven, THRESHOLD } from "./framing.js";
import { median, SECOND_COLOUR, secondColour } from "./saturation.js";

const CONFIDENT = 0.925;
const SMALLEST_SHARE = 0.04;
const FEWEST_PIXELS = 64;
const LARGEST_PART = 0.9;
const [ON_FRAME, NEAR_FRAME] = [0.01, 1 / 128];
const DARKEST = 0.05;
const [BRIGHT, FEWEST_BRIGHT] = [170, 0.01];
const CLIPPED = 0.15;
const BURNT = 0.01;
const [GREY, GREY_SHARE] = [2, 0.99];
const SPREAD = 0.11;
const [PATCHES, FEWEST_PATCHES, DARK, NEAR] = [48, 24, 0.01, 0.8]; // `dichromatic.colour_spread`
const WHITE = 254;
const JUDGED = 20_000;
const LUMINANCE = [0.2126, 0.7152, 0.0722];

/** The IoU that a mask is expected to have with the true one; null if no pixel reaches one half. */
export function confidence(mask) {
  let [count, shared, outside] = [0, 0, 0];
  for (const value of mask) {
    if (value >= THRESHOLD) {
      count++;
      shared += value;
    } else outside += value;
  }
  return count ? shared / (count + outside) : null;
}

/**
 * The codes of the reasons, in Python's order. `inside` has a byte a pixel of the photo, not 0 where
 * the object is; `maskConfidence` is null for a mask that was given.
 */
export function codes(photo, inside, maskConfidence) {
  const { width, height } = photo;
  const count = inside.reduce((sum, value) => sum + (value ? 1 : 0), 0);
  if (!count) return ["no-object"];
  const pixels = judged(photo, inside, count);
  const white = share(pixels, (levels) => Math.min(...levels) >= WHITE);
  const grey = share(pixels, (levels) => Math.max(...levels) - Math.min(...levels) <= GREY);
  const isDark = brightTenth(pixels) < DARKEST;
  const searched = maskConfidence !== null;
  const found = {
    "uncertain-mask": searched && maskConfidence < CONFIDENT,
    "small-object": searched && count / (width * height) < SMALLEST_SHARE,
    "few-pixels": extent(inside, width, height) < FEWEST_PIXELS,
    "touches-frame": onFrame(inside, width, height) > ON_FRAME,
    "many-parts": largestPart(inside, width, height) / count < LARGEST_PART,
    "too-dark": isDark,
    underexposed: !isDark && brightShare(photo) < FEWEST_BRIGHT,
    clipped: white > CLIPPED,
    "burnt-highlight": white > BURNT && white <= CLIPPED,
    grey: grey >= GREY_SHARE,
    "second-colour": grey < GREY_SHARE && isOfSeveralColours(),
  };
  return Object.keys(found).filter((code) => found[code]);

  function isOfSeveralColours() {
    if (colourSpread(photo, inside) > SPREAD) return true;
    const linear = pixels
      .filter((levels) => Math.max(...levels) < WHITE)
      .map((levels) => levels.map((level) => LINEAR[level]));
    return secondColour(linear) > SECOND_COLOUR;
  }
}

/** The longer side of the box around all that is inside. */
function extent(inside, width, height) {
  let [left, right, top, bottom] = [width, -1, height, -1];
  for (let row = 0, at = 0; row < height; row++) {
    for (let column = 0; column < width; column++, at++) {
      if (!inside[at]) continue;
      left = Math.min(left, column);
      right = Math.max(right, column);
      top = Math.min(top, row);
      bottom = row;
    }
  }
  return Math.max(right - left, bottom - top) + 1;
}

/** The share of the photo's outline that is reached. */
function onFrame(inside, width, height) {
  const near = 1 + roundHalfEven(NEAR_FRAME * Math.max(width, height));
  const edge = (across, along, step, stride) => {
    let reached = 0;
    for (let at = 0; at < along; at++) {
      for (const first of [0, Math.max(across - near, 0)]) {
        for (let line = first; line < Math.min(first + near, across); line++) {
          if (!inside[line * step + at * stride]) continue;
          reached++;
          break;
        }
      }
    }
    return reached;
  };
  const reached = edge(height, width, width, 1) + edge(width, height, 1, width);
  return reached / (2 * (width + height));
}

/** The number of pixels of the largest part, joined along edges. */
function largestPart(inside, width, height) {
  const open = Uint8Array.from(inside);
  const stack = [];
  let most = 0;
  for (let start = 0; start < open.length; start++) {
    if (!open[start]) continue;
    let pixels = 0;
    open[start] = 0;
    stack.push(start);
    const visit = (at) => {
      if (!open[at]) return;
      open[at] = 0;
      stack.push(at);
    };
    while (stack.length) {
      const at = stack.pop();
      const column = at % width;
      pixels++;
      if (at >= width) visit(at - width);
      if (at < width * (height - 1)) visit(at + width);
      if (column > 0) visit(at - 1);
      if (column < width - 1) visit(at + 1);
    }
    most = Math.max(most, pixels);
  }
  return most;
}

const divisor = (a, b) => (b ? divisor(b, a % b) : a);

/** The levels [R, G, B] of `JUDGED` of the object's pixels, about; of a whole photo, from all columns. */
function judged({ data }, inside, count, width = 1) {
  let step = Math.max(1, Math.floor(count / JUDGED));
  while (divisor(step, width) > 1) step++;
  const pixels = [];
  for (let at = 0, seen = 0; at < inside.length; at++) {
    if (!inside[at] || seen++ % step) continue;
    pixels.push([data[4 * at], data[4 * at + 1], data[4 * at + 2]]);
  }
  return pixels;
}

const share = (pixels, is) => pixels.reduce((sum, levels) => sum + (is(levels) ? 1 : 0), 0) / pixels.length;

/** The share of a photo's pixels of which a channel reaches BRIGHT; black ones apart. */
function brightShare(photo) {
  const count = photo.width * photo.height;
  const all = judged(photo, new Uint8Array(count).fill(1), count, photo.width).map((levels) => Math.max(...levels));
  const lit = all.filter((level) => level > 0);
  return lit.filter((level) => level >= BRIGHT).length / Math.max(lit.length, 1);
}

/** The luminance that a tenth of the pixels exceeds. */
function brightTenth(pixels) {
  const luminances = pixels.map((levels) =>
    levels.reduce((sum, level, k) => sum + LUMINANCE[k] * LINEAR[level], 0),
  );
  luminances.sort((a, b) => a - b);
  const place = 0.9 * (luminances.length - 1);
  const below = luminances[Math.floor(place)];
  const above = luminances[Math.ceil(place)];
  return below + (above - below) * (place % 1);
}

/** How far the colours of the object's patches are from one, 0 for one colour. */
export function colourSpread({ data, width, height }, inside) {
  // The box around the object, and the patches that fill it.
  let [left, right, top, bottom] = [width, -1, height, -1];
  for (let at = 0; at < inside.length; at++) {
    if (!inside[at]) continue;
    const column = at % width;
    left = Math.min(left, column);
    right = Math.max(right, column);
    top = Math.min(top, Math.floor(at / width));
    bottom = Math.floor(at / width);
  }
  if (right < 0) return 0;
  const longer = Math.max(right - left, bottom - top) + 1;
  const step = Math.max(1, Math.floor(longer / (4 * PATCHES)));
  const patch = Math.max(1, Math.ceil(longer / (step * PATCHES)));
  const high = Math.floor(Math.ceil((bottom - top + 1) / step) / patch);
  const wide = Math.floor(Math.ceil((right - left + 1) / step) / patch);

  // The relative chroma of each patch that the object fills.
  const chromas = [];
  for (let place = 0; place < high * wide; place++) {
    const chroma = patchChroma(place);
    if (chroma) chromas.push(chroma);
  }
  if (chromas.length < FEWEST_PATCHES) return 0;
  const centre = [0, 1, 2].map((k) => median(chromas.map((one) => one[k])));
  const from = (middle) => (one) => one.reduce((sum, value, k) => sum + (value - middle[k]) ** 2, 0);
  const near = chromas
    .sort((a, b) => from(centre)(a) - from(centre)(b))
    .slice(0, roundHalfEven(NEAR * chromas.length));
  const mean = [0, 1, 2].map((k) => near.reduce((sum, one) => sum + one[k], 0) / near.length);
  return Math.sqrt(near.map(from(mean)).reduce((sum, square) => sum + square, 0) / near.length);

  function patchChroma(place) {
    const sums = [0, 0, 0];
    for (let pixel = 0; pixel < patch * patch; pixel++) {
      const row = top + step * (Math.floor(place / wide) * patch + Math.floor(pixel / patch));
      const column = left + step * ((place % wide) * patch + (pixel % patch));
      const at = row * width + column;
      const levels = [data[4 * at], data[4 * at + 1], data[4 * at + 2]];
      if (!inside[at] || Math.max(...levels) >= WHITE) return null;
      levels.forEach((level, k) => (sums[k] += LINEAR[level] / patch ** 2));
    }
    const grey = (sums[0] + sums[1] + sums[2]) / 3;
    return sums.map((value) => (value - grey) / (grey + DARK));
  }
}
