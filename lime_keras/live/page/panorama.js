// Equirectangular light: {width, height, data}, linear radiance, rows from the top, camera space.
// direction(u, v) = (sin πv · sin 2πu, cos πv, −sin πv · cos 2πu), as in optics/environment.py.

import { toLevel } from "./colour.js";

const LIGHTS = [
  [[-0.25, 0.7, 0.6], 80, 0.42],
  [[-0.6, 0.6, 0.55], 7, 45],
  ...[-0.15, 0, 0.15, 0.3, 0.45].map((height) => [[0.9, height, 0.35], 6, 3]),
];

/** Unit direction through the middle of a texel. */
export function direction(row, column, width, height) {
  const theta = (Math.PI * (row + 0.5)) / height;
  const phi = (2 * Math.PI * (column + 0.5)) / width;
  return [Math.sin(theta) * Math.sin(phi), Math.cos(theta), -Math.sin(theta) * Math.cos(phi)];
}

/** Solid angle in steradians of a texel of a row; all together have 4π. */
export function solidAngle(row, width, height) {
  const edge = (index) => Math.cos((Math.PI * index) / height);
  return ((edge(row) - edge(row + 1)) * 2 * Math.PI) / width;
}

/** The studio of optics/studio_light.py: a wide dim fill, a small lamp and a strip. */
export function studio() {
  const [width, height] = [128, 64];
  const data = new Float32Array(width * height);
  for (const [towards, radius, strength] of LIGHTS) {
    const length = Math.hypot(...towards);
    const least = Math.cos((radius * Math.PI) / 180);
    for (let row = 0, at = 0; row < height; row++) {
      for (let column = 0; column < width; column++, at++) {
        const i = direction(row, column, width, height);
        const cosine = (i[0] * towards[0] + i[1] * towards[1] + i[2] * towards[2]) / length;
        if (cosine > least) data[at] = strength;
      }
    }
  }
  return { width, height, data };
}

/** A light turned about the vertical by an angle in radians, and made `factor` times as bright. */
export function turned(light, angle, factor) {
  const { width, height } = light;
  const data = new Float32Array(width * height);
  const shift = (((angle / (2 * Math.PI)) % 1) + 1) * width;
  const whole = Math.floor(shift);
  const share = shift - whole;
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      const right = light.data[row * width + ((column - whole + 2 * width) % width)];
      const left = light.data[row * width + ((column - whole - 1 + 2 * width) % width)];
      data[row * width + column] = factor * (right * (1 - share) + left * share);
    }
  }
  return { width, height, data };
}

/**
 * RGBA levels of a light for viewing, with what lies before the camera in the middle; bright parts
 * are compressed, as in NAME-environment.png.
 */
export function picture(light) {
  const { width, height, data } = light;
  const pixels = new Uint8ClampedArray(4 * width * height);
  for (let row = 0, at = 0; row < height; row++) {
    for (let column = 0; column < width; column++, at += 4) {
      const value = data[row * width + column];
      pixels.fill(toLevel(value / (1 + value)), at, at + 3);
      pixels[at + 3] = 255;
    }
  }
  return pixels;
}
