// D and S (Eqs. 2 and 3) of all normals, for a viewer far away: the tables that light the object.
//
// With o = (0, 0, 1) for every pixel, D and S depend on the normal alone. A table has `size` ×
// `size` normals in Lambert's equal-area map: the texel at p in [−1, 1]², y up from the first row,
// holds n = (p √(2 − |p|²), 1 − |p|²); so p = n.xy / √(1 + n.z). The sums run over the texels of a
// panorama, normalised to the white furnace, as in optics/shading.py, which the tests hold them to.

import { direction, solidAngle } from "./panorama.js";

/** Normals further from the viewer than this are never seen, and stay 0. */
const LEAST_Z = -0.2;
/** Share of a lobe's peak below which it is left out. */
const TAIL = 1e-5;
/** Exponent up to which a quarter of the texels is enough: the lobe is wider than they are. */
const WIDE = 32;
const STEPS = 4096;

/** c(s), which makes S = 1 in a furnace at n = o. */
export function normaliser(exponent) {
  return (exponent + 2) / (8 * Math.PI * -Math.expm1(-(exponent + 2) * 0.5 * Math.LN2));
}

/** The lights of a panorama, `step` × `step` texels as one: x, y, z and energy, four a light. */
export function lights(panorama, step) {
  const { width, height, data } = panorama;
  const out = [];
  for (let row = 0; row < height; row += step) {
    for (let column = 0; column < width; column += step) {
      let [x, y, z, energy] = [0, 0, 0, 0];
      for (let r = row; r < Math.min(row + step, height); r++) {
        for (let c = column; c < Math.min(column + step, width); c++) {
          const part = data[r * width + c] * solidAngle(r, width, height);
          const i = direction(r, c, width, height);
          x += part * i[0];
          y += part * i[1];
          z += part * i[2];
          energy += part;
        }
      }
      const length = Math.hypot(x, y, z);
      if (energy > 0 && length > 0) out.push(x / length, y / length, z / length, energy);
    }
  }
  return Float32Array.from(out);
}

/** The normals of a table: x, y, z, three a texel. */
export function tableNormals(size) {
  const out = new Float32Array(3 * size * size);
  for (let row = 0, at = 0; row < size; row++) {
    const v = (2 * row + 1) / size - 1;
    for (let column = 0; column < size; column++, at += 3) {
      const u = (2 * column + 1) / size - 1;
      const square = u * u + v * v;
      const scale = Math.sqrt(2 - square);
      out[at] = u * scale;
      out[at + 1] = v * scale;
      out[at + 2] = 1 - square;
    }
  }
  return out;
}

/** Normals along a side of the table that S of an exponent takes: as fine as its lobe asks. */
export function fineness(exponent, size) {
  return Math.min(size, exponent <= 16 ? 32 : exponent <= 64 ? 64 : size);
}

/** A table of `from`² made `to`² texels, interpolated linearly; at the rim, its own last texels. */
export function enlarged(table, from, to) {
  if (from === to) return table;
  const out = new Float32Array(to * to);
  const along = Array.from({ length: to }, (_, at) => {
    const place = Math.min(Math.max(((at + 0.5) * from) / to - 0.5, 0), from - 1);
    const first = Math.min(Math.floor(place), from - 2);
    return [first, place - first];
  });
  for (let row = 0, at = 0; row < to; row++) {
    const [r, down] = along[row];
    for (let column = 0; column < to; column++, at++) {
      const [c, across] = along[column];
      const k = r * from + c;
      const above = table[k] + (table[k + 1] - table[k]) * across;
      const below = table[k + from] + (table[k + from + 1] - table[k + from]) * across;
      out[at] = above + (below - above) * down;
    }
  }
  return out;
}

/** The table of D, linear radiance, `size`². */
export function diffuse(panorama, size) {
  const normals = tableNormals(size);
  const list = lights(panorama, 2);
  const out = new Float32Array(size * size);
  for (let index = 0; index < out.length; index++) {
    const x = normals[3 * index];
    const y = normals[3 * index + 1];
    const z = normals[3 * index + 2];
    if (z < LEAST_Z) continue;
    let sum = 0;
    for (let at = 0; at < list.length; at += 4) {
      const cosine = x * list[at] + y * list[at + 1] + z * list[at + 2];
      if (cosine > 0) sum += cosine * list[at + 3];
    }
    out[index] = sum / Math.PI;
  }
  return out;
}

/** The table of S, linear radiance, `size`², of an exponent of at least 0. */
export function specular(panorama, exponent, size) {
  const normals = tableNormals(size);
  const list = lights(panorama, exponent <= WIDE ? 2 : 1);
  const out = new Float32Array(size * size);
  // Below this h·n the lobe is left out; the table holds it above.
  const least = exponent > 0 ? TAIL ** (1 / exponent) : 0;
  const lobe = Float32Array.from({ length: STEPS + 2 }, (_, step) =>
    Math.min(least + ((1 - least) * step) / STEPS, 1) ** exponent,
  );
  const scale = STEPS / Math.max(1 - least, 1e-12);
  // In the map, a step of an angle is at most 1.15 times as long, up to 100° from the middle.
  const reach = 1.15 * Math.acos(least);
  const texel = (p) => ((p + 1) * size - 1) / 2;
  for (let at = 0; at < list.length; at += 4) {
    const x = list[at];
    const y = list[at + 1];
    const z = list[at + 2];
    const length = Math.sqrt(2 + 2 * z);
    if (length < 1e-6) continue; // exactly opposite: no half vector
    // The half vector's place in the map, and the texels around it that the lobe reaches.
    const root = Math.sqrt(1 + (z + 1) / length);
    const [u, v] = [x / length / root, y / length / root];
    const first = Math.max(0, Math.floor(texel(u - reach)));
    const last = Math.min(size - 1, Math.ceil(texel(u + reach)));
    const bottom = Math.max(0, Math.floor(texel(v - reach)));
    const top = Math.min(size - 1, Math.ceil(texel(v + reach)));
    const energy = list[at + 3];
    for (let row = bottom; row <= top; row++) {
      for (let index = row * size + first; index <= row * size + last; index++) {
        const nz = normals[3 * index + 2];
        if (nz < LEAST_Z) continue;
        const across = x * normals[3 * index] + y * normals[3 * index + 1] + z * nz + nz;
        if (across <= (nz > 0 ? nz : 0)) continue; // i·n > 0 and h·n > 0
        const place = (across / length - least) * scale;
        if (place < 0) continue;
        const step = Math.min(Math.floor(place), STEPS);
        out[index] += energy * (lobe[step] + (lobe[step + 1] - lobe[step]) * (place - step));
      }
    }
  }
  const factor = normaliser(exponent);
  for (let index = 0; index < out.length; index++) out[index] *= factor;
  return out;
}
