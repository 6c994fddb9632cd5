// The worker that sums the tables, so that the page never waits for them.

import { diffuse, enlarged, fineness, specular } from "./shading.js";

/** Normals along a side of the table of D, whose lobe is the widest. */
const DIFFUSE = 32;

let last = { key: null, diffuse: null };

onmessage = ({ data: { light, key, exponents, size } }) => {
  const begun = performance.now();
  // The light changes less often than the gloss.
  if (last.key !== key) last = { key, diffuse: enlarged(diffuse(light, DIFFUSE), DIFFUSE, size) };
  const parts = exponents.map((exponent) => {
    const side = fineness(exponent, size);
    return enlarged(specular(light, exponent, side), side, size);
  });
  // D, S of the first material, D, S of the second: a texel of the texture.
  const texels = new Float32Array(4 * size * size);
  for (let index = 0; index < size * size; index++) {
    texels[4 * index] = texels[4 * index + 2] = last.diffuse[index];
    texels[4 * index + 1] = parts[0][index];
    texels[4 * index + 3] = parts[parts.length - 1][index];
  }
  postMessage({ texels, ms: performance.now() - begun }, [texels.buffer]);
};
