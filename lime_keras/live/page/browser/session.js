// A stream of frames and what is known of its object: lime_keras/live/session.py, with the graphs
// run by a function instead of the estimator.

import { toLinear, toSrgb } from "../colour.js";
import * as cautions from "./cautions.js";
import { withContrast } from "./contrast.js";
import * as framing from "./framing.js";
import * as lighting from "./light.js";
import { normals } from "./normals.js";
import { raised } from "./saturation.js";
import { Fusion, Tracker } from "./tracking.js";

const BIN_WIDTH = 0.375; // Decades of s.
const WARNED_EVERY = 10; // Frames after which warnings are looked for without layers, too.
const LIGHT_PIXELS = 64; // Height and width to which a square is reduced for its light.
const BLACK = 1e-4; // Squared length of m_d up to which its diffuse layer is only noise.
const [HIDING, WHITE] = [0.5, 254 / 255]; // `highlights`
const FOCAL = 1.2; // Focal length over the photo's longer side: `shading.ASSUMED_FOCAL`.

export class Session {
  /**
   * @param run Function of a graph's name and of quantities by name, Float32Arrays, that returns
   *   the graph's outputs by name, Float32Arrays: `mask` from `image`, `material` from `image` and
   *   `mask`, `layers` from these and what `material` answers; nothing if there is no such graph.
   * @param size Height and width of the graphs' images.
   */
  constructor(run, size) {
    this.run = run;
    this.size = size;
    this.restart();
  }

  /** Forget all frames, because another stream begins. */
  restart() {
    this.tracker = new Tracker();
    this.light = new Fusion();
    this.square = null; // Where the object was in the last frame.
    this.warned = [];
    this.unwarned = WARNED_EVERY;
  }

  /** Estimate the next frame; frame and answer are those of the page's engines. */
  async answer({ number, image, mask: given, options }) {
    const { size } = this;
    const { width, height } = image;
    const ms = {};
    const begun = performance.now();
    let last = begun;
    const lap = (name) => {
      const now = performance.now();
      ms[name] = now - last;
      last = now;
    };
    const view = await (given ? this.viewGiven(image, given) : this.look(image));
    this.square = given ? null : framing.following(view.mask, size, view.square, height, width);
    const inside = framing.insidePhoto(view.square, height, width, size);
    const covered = view.mask.reduce(
      (sum, value, at) => sum + (value >= framing.THRESHOLD && inside[at] ? 1 : 0),
      0,
    );
    const share = (covered * (view.square.side / size) ** 2) / (height * width);
    lap("framing_and_mask");
    const found = covered > 0;
    let layers = null;
    if (options.material && found) {
      layers = await this.run("material", { image: view.seen, mask: view.mask });
      if (layers.diffuse_albedo) {
        const albedo = raised([...layers.diffuse_albedo], view.seen, view.mask);
        layers = { ...layers, diffuse_albedo: albedo };
      }
      if (options.layers || options.light) {
        layers = { ...layers, ...(await this.run("layers", { image: view.seen, mask: view.mask, ...layers })) };
      }
      lap("material");
    }
    const material = layers && materialOf(layers);
    const { cut, fused } = this.tracker.step(image, found, parameters(options.fusion ? material : null));
    if (cut || fused.every(Number.isNaN)) this.light.restart();
    if (cut) this.square = null;
    const warned = [...this.doubts(image, view, given, found, options)];
    let light = null;
    if (options.light && material) {
      const told = this.lit(view, inside, layers, image);
      if (told === null) warned.push("no-light");
      else light = options.fusion ? this.light.update(told) : told;
      lap("light");
    }
    ms.total = performance.now() - begun;
    return {
      number,
      width,
      height,
      found,
      cut,
      size,
      square: [view.square.top, view.square.left, view.square.side],
      mask_coverage: Math.min(share, 1),
      mask_confidence: given ? null : cautions.confidence(view.mask),
      material,
      fused: options.fusion ? fusedMaterial(fused) : null,
      layers: {
        mask: Uint8Array.from(view.mask, (value) => Math.round(255 * value)),
        specular_shading: (options.layers && layers?.specular_shading) || null,
        mirror: (options.layers && layers?.mirror) || null,
      },
      light: light && { width: lighting.COLUMNS, height: lighting.ROWS, data: plain(light) },
      ms,
      warnings: warned.map((code) => ({ code })),
    };
  }

  /** The view of where the object was, if it is still there; else that of the whole frame. */
  async look(image) {
    const { square, size } = this;
    if (square === null) return this.view(image);
    const seen = framing.cut(image, square, size);
    const { mask } = await this.run("mask", { image: seen });
    const isThere = framing.following(mask, size, square, image.height, image.width) !== null;
    return isThere ? { square, seen, mask } : this.view(image);
  }

  /** The square that the networks see, its content and the object found in it. */
  async view(image) {
    const { size } = this;
    const square = framing.whole(image.height, image.width);
    const seen = framing.cut(image, square, size);
    const { mask } = await this.run("mask", { image: seen });
    const closer = framing.around(mask, size, square);
    if (closer !== square) {
      const near = framing.cut(image, closer, size);
      const again = await this.run("mask", { image: near });
      // If the closer view shows no object, keep the whole photo.
      if (again.mask.some((value) => value >= framing.THRESHOLD)) {
        return { square: closer, seen: near, mask: again.mask };
      }
    }
    return { square, seen, mask };
  }

  async viewGiven(image, given) {
    const { width, height } = image;
    const coverage = Float32Array.from(given, (level) => level / 255);
    const square = framing.aroundGiven(coverage, height, width);
    return {
      square,
      seen: framing.cut(image, square, this.size),
      mask: framing.cutLayer(coverage, height, width, square, this.size),
    };
  }

  /** The codes of the reasons, of this frame or the last one in which they were looked for. */
  doubts(image, view, given, found, options) {
    this.unwarned++;
    if (!found) [this.warned, this.unwarned] = [["no-object"], WARNED_EVERY];
    else if (!options.material) return [];
    else if (options.layers || this.unwarned >= WARNED_EVERY) {
      [this.warned, this.unwarned] = [this.cautions(image, view, given), 0];
    }
    return this.warned;
  }

  /** The reasons to distrust the estimate of a view, of a mask that was given or of its own. */
  cautions(image, view, given) {
    const { width, height } = image;
    if (given) return cautions.codes(image, given.map((level) => (level >= 128 ? 1 : 0)), null);
    const inside = framing.inside(view.mask, this.size, view.square, height, width);
    return cautions.codes(image, inside, cautions.confidence(view.mask));
  }

  /** The light in camera space; null if it cannot be estimated. */
  lit(view, inside, layers, { width, height }) {
    const material = materialOf(layers);
    if (!layers.mirror || !layers.specular_shading) return null;
    if (Object.values(material).slice(0, 3).includes(null)) return null;
    const { top, left, side } = view.square;
    const step = Math.floor(this.size / LIGHT_PIXELS);
    const by = step > 1 && this.size % step === 0 ? step : 1;
    const size = this.size / by;
    const small = (values, channels = 1) => means(values, this.size, by, channels);
    // What lies beyond the photo was not seen.
    const mask = small(view.mask.map((value, at) => (inside[at] ? value : 0)));
    const seen = small(view.seen.map(toLinear), 3).map(toSrgb);
    const specular = small(layers.specular_shading);
    const focal = (FOCAL * Math.max(height, width) * size) / side;
    const camera = [
      ...[focal, focal],
      ...[((width / 2 - left) * size) / side, ((height / 2 - top) * size) / side],
    ];
    const normal = normals(mask, size, size);
    // M is nowhere below S on the average: S is M, blurred. MirrorNet makes lamps too weak.
    const mirror = small(layers.mirror).map((value, at) => Math.max(value, specular[at]));
    const shading = diffuseShading(seen, mask, specular, layers);
    const light = lighting.estimated(normal, mirror, shading, mask, size, camera);
    if (light === null) return null;
    const object = [...mask.keys()].filter((at) => mask[at] >= framing.THRESHOLD);
    const faces = Float32Array.from({ length: 3 * object.length }, (_, at) => {
      return normal[3 * object[Math.floor(at / 3)] + (at % 3)];
    });
    const brightness = object.map((at) => greyOf(seen, at));
    return withContrast(light, faces, brightness, material);
  }
}

/** The means of areas of `by` × `by` pixels of a picture of `size` × `size`. */
function means(values, size, by, channels) {
  const out = new Float32Array((size / by) ** 2 * channels);
  for (let at = 0; at < values.length; at++) {
    const pixel = Math.floor(at / channels);
    const row = Math.floor(pixel / size / by);
    const column = Math.floor((pixel % size) / by);
    out[(row * (size / by) + column) * channels + (at % channels)] += values[at] / by ** 2;
  }
  return out;
}

/** The mean of linear R, G and B of a pixel. */
function greyOf(seen, at) {
  return (toLinear(seen[3 * at]) + toLinear(seen[3 * at + 1]) + toLinear(seen[3 * at + 2])) / 3;
}

/** Whether the diffuse part of a pixel cannot be read: lime_keras/optics/highlights.py. */
function isHidden(seen, at, specular) {
  const clipped = Math.max(seen[3 * at], seen[3 * at + 1], seen[3 * at + 2]) >= WHITE;
  return clipped || specular > HIDING * greyOf(seen, at);
}

/** D, NaN if m_d is black or it is hidden: the picture without m_s · S, over m_d. */
function diffuseShading(seen, mask, shadings, layers) {
  const albedo = layers.diffuse_albedo;
  const square = albedo.reduce((sum, value) => sum + value * value, 0);
  return shadings.map((shading, at) => {
    if (!(square > BLACK)) return NaN;
    const specular = layers.specular_albedo[0] * shading;
    if (isHidden(seen, at, specular)) return NaN;
    let sum = 0;
    for (let channel = 0; channel < 3; channel++) {
      const diffuse = Math.max(toLinear(seen[3 * at + channel]) - specular, 0) * mask[at];
      sum += diffuse * albedo[channel];
    }
    return sum / square;
  });
}

/** The numbers of a material; null for what the model does not estimate. */
function materialOf(layers) {
  const probabilities = layers.exponent_bin_probabilities;
  const log = probabilities
    ? probabilities.reduce((sum, value, bin) => sum + value * BIN_WIDTH * (bin + 0.5), 0)
    : layers.log_exponent?.[0];
  return {
    diffuse_albedo: layers.diffuse_albedo ? [...layers.diffuse_albedo] : null,
    specular_albedo: layers.specular_albedo?.[0] ?? null,
    exponent: log === undefined ? null : 10 ** log,
    exponent_bin_probabilities: probabilities ? [...probabilities] : null,
    exponent_entropy: probabilities
      ? probabilities.reduce((sum, value) => sum - (value > 0 ? value * Math.log2(value) : 0), 0)
      : null,
  };
}

/** What is fused over time: m_d, m_s and log10 s; NaN for what was not estimated. */
function parameters(material) {
  const [red, green, blue] = material?.diffuse_albedo ?? [NaN, NaN, NaN];
  const exponent = material?.exponent;
  const log = exponent ? Math.log10(exponent) : NaN;
  return [red, green, blue, material?.specular_albedo ?? NaN, log];
}

function fusedMaterial(fused) {
  if (fused.every(Number.isNaN)) return null;
  const known = (value) => (Number.isNaN(value) ? null : value);
  return {
    diffuse_albedo: Number.isNaN(fused[0]) ? null : [...fused.slice(0, 3)],
    specular_albedo: known(fused[3]),
    exponent: Number.isNaN(fused[4]) ? null : 10 ** fused[4],
  };
}

function plain(radiance) {
  return Float32Array.from(radiance, (value) => (Number.isFinite(value) ? value : 0));
}
