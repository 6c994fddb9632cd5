// sRGB and linear light, one number or a picture at a time.

/** Linear radiance of an sRGB value, both in [0, 1]. */
export function toLinear(value) {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

/** sRGB value of a linear radiance, which is clipped to [0, 1]. */
export function toSrgb(value) {
  const clipped = Math.min(Math.max(value, 0), 1);
  return clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * clipped ** (1 / 2.4) - 0.055;
}

/** Linear radiance of each of the 256 levels. */
export const LINEAR = Float32Array.from({ length: 256 }, (_, level) => toLinear(level / 255));

const STEPS = 4096;
const LEVELS = Uint8Array.from({ length: STEPS + 1 }, (_, step) =>
  Math.round(255 * toSrgb((step / STEPS) ** 2)),
);

/** Level 0…255 of a linear radiance, clipped to [0, 1]. */
export function toLevel(value) {
  // Levels are dense near black: the table's steps are even in the square root.
  return LEVELS[Math.round(Math.sqrt(Math.min(Math.max(value, 0), 1)) * STEPS)];
}

/** Linear RGB, clipped, as sRGB #rrggbb. */
export function hex(linear) {
  const levels = linear.map((value) => Math.round(255 * toSrgb(value)));
  return "#" + levels.map((level) => level.toString(16).padStart(2, "0")).join("");
}

/** Linear RGB as a CSS colour. */
export function css(linear) {
  return `rgb(${linear.map((value) => Math.round(255 * toSrgb(value))).join(" ")})`;
}
