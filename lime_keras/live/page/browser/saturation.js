// An albedo as saturated as half of the object's pixels: lime_keras/optics/dichromatic.py.

import { toLinear } from "../colour.js";
import { THRESHOLD } from "./framing.js";

export const SECOND_COLOUR = 0.15;
const [CLIPPED, DARK, LEAST_CHROMA] = [0.999, 2e-3, 1e-3];
const FEWEST = 64;
const [LOW, HIGH] = [0.5, 0.65];

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const greyOf = (colour) => (colour[0] + colour[1] + colour[2]) / 3;
const chromaOf = (colour) => colour.map((value) => value - greyOf(colour));

/** The median of numbers. */
export function median(values) {
  const sorted = Float64Array.from(values).sort();
  const middle = (sorted.length - 1) / 2;
  return (sorted[Math.floor(middle)] + sorted[Math.ceil(middle)]) / 2;
}

/** How much colour pixels, linear RGB, have beside their own, over their brightness. */
export function secondColour(pixels) {
  const brightness = pixels.reduce((sum, pixel) => sum + greyOf(pixel), 0) / pixels.length;
  if (!(brightness > 0)) return 0;
  const chroma = pixels.map(chromaOf);
  const mean = [0, 1, 2].map((k) => chroma.reduce((sum, one) => sum + one[k], 0) / chroma.length);
  const length = Math.hypot(...mean);
  const direction = length > LEAST_CHROMA ? mean.map((value) => value / length) : [0, 0, 0];
  const squares = chroma.reduce((sum, one) => sum + dot(one, one) - dot(one, direction) ** 2, 0);
  return Math.sqrt(Math.max(squares, 0) / chroma.length) / brightness;
}

/** The albedo; `seen` holds sRGB in [0, 1] by pixel and channel, `mask` the coverage. */
export function raised(albedo, seen, mask) {
  const mean = greyOf(albedo);
  const own = chromaOf(albedo);
  const length = Math.hypot(...own);
  const pixels = [];
  mask.forEach((value, at) => {
    const levels = [seen[3 * at], seen[3 * at + 1], seen[3 * at + 2]];
    if (value >= THRESHOLD && Math.max(...levels) < CLIPPED) pixels.push(levels.map(toLinear));
  });
  if (pixels.length < FEWEST || length <= LEAST_CHROMA) return albedo;
  if (secondColour(pixels) > SECOND_COLOUR) return albedo;
  const ratios = pixels.map((one) => Math.hypot(...chromaOf(one)) / (greyOf(one) + DARK));
  const middle = median(ratios);
  const share = Math.min(Math.max((middle - LOW) / (HIGH - LOW), 0), 1);
  const wanted = 1 + share * Math.max((middle * mean) / length - 1, 0);
  // No channel may leave [0, 1].
  const room = own.map((value) => (value < 0 ? mean : 1 - mean) / Math.max(Math.abs(value), 1e-20));
  const factor = Math.min(wanted, Math.max(Math.min(...room), 1));
  return own.map((value) => mean + factor * value);
}
