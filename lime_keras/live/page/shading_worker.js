// The worker that sums the tables, so that the page never waits for them.

import { diffuse, specular } from "./shading.js";

let last = { key: null, diffuse: null };

onmessage = ({ data: { id, light, key, exponents, size } }) => {
  // The light changes less often than the gloss.
  if (last.key !== key || key === null) last = { key, diffuse: diffuse(light, size) };
  const parts = exponents.map((exponent) => specular(light, exponent, size));
  // D, S of the first material, D, S of the second: a texel of the texture.
  const texels = new Float32Array(4 * size * size);
  for (let index = 0; index < size * size; index++) {
    texels[4 * index] = texels[4 * index + 2] = last.diffuse[index];
    texels[4 * index + 1] = parts[0][index];
    texels[4 * index + 3] = parts[parts.length - 1][index];
  }
  postMessage({ id, texels }, [texels.buffer]);
};
