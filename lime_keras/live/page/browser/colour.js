// sRGB and linear radiance: lime_keras/optics/colour.py.

export function srgbToLinear(srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : ((srgb + 0.055) / 1.055) ** 2.4;
}

export function linearToSrgb(linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * linear ** (1 / 2.4) - 0.055;
}

// Linear radiance of each of the 256 levels of a picture.
export const LINEAR_OF_LEVEL = Float32Array.from({ length: 256 }, (_, level) =>
  srgbToLinear(Math.fround(level / 255)),
);
