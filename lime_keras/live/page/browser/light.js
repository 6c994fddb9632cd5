// The light of a scene from M and D of an object: lime_keras/lighting/illumination.py and the maps
// of lime_keras/optics/environment.py. Maps are Float64Arrays of rows × columns, row by row.

import { direction, solidAngle } from "../panorama.js";

export const [ROWS, COLUMNS] = [64, 128];
const [NORMAL_ROWS, NORMAL_COLUMNS] = [32, 64];
const SCALES = [8, 4, 2, 1, 0];
const TRUST = 0.05;
const LEAST_COSINE = 0.02;
const COSINE_LOBE = [1, 2 / 3, 2 / 3, 2 / 3, 1 / 4, 1 / 4, 1 / 4, 1 / 4, 1 / 4];
const RIDGE = 3e-3;

/**
 * The light, ROWS × COLUMNS of linear radiance in camera space; null if no pixel shows any.
 *
 * `normal` has three numbers a pixel; `mirror`, `shading` (D, NaN where not known) and `mask` one,
 * of `size` × `size` pixels; `camera` is [fx, fy, cx, cy] in these pixels.
 */
export function estimated(normal, mirror, shading, mask, size, camera) {
  const evidence = observed(normal, mirror, shading, mask, size, camera);
  if (!evidence.mirrorWeight.some(Boolean) && !evidence.diffuseWeight.some(Boolean)) return null;
  const { light, unseen } = filled(evidence);
  const shaded = [];
  evidence.diffuseWeight.forEach((weight, at) => weight > 0 && shaded.push(at));
  if (shaded.length === 0) {
    let [total, seen] = [0, 0];
    light.forEach((value, at) => {
      total += value * SOLID_ANGLES[at];
      seen += (1 - unseen[at]) * SOLID_ANGLES[at];
    });
    return light.map((value, at) => value + (unseen[at] * total) / seen);
  }
  const weights = shaded.map((at) => evidence.diffuseWeight[at]);
  const whole = weights.reduce((sum, weight) => sum + weight, 0);
  const values = shaded.map((at) => evidence.diffuse[at] / evidence.diffuseWeight[at]);
  const even = values.reduce((sum, value, at) => sum + value * weights[at], 0) / whole;
  const fitted = (target) => lowFrequencies(target, weights, whole, shaded);
  const low = fitted(values.map((value) => value - even));
  for (let at = 0; at < light.length; at++) light[at] += unseen[at] * Math.max(even + low[at], 0);
  const found = shadingOf(light, shaded);
  const correction = fitted(values.map((value, at) => value - found[at]));
  return light.map((value, at) => Math.max(value + correction[at], 0));
}

/** The weighted sums of M and D by direction, and the sums of the weights. */
function observed(normal, mirror, shading, mask, size, [fx, fy, cx, cy]) {
  const evidence = {
    mirror: new Float64Array(ROWS * COLUMNS),
    mirrorWeight: new Float64Array(ROWS * COLUMNS),
    diffuse: new Float64Array(NORMAL_ROWS * NORMAL_COLUMNS),
    diffuseWeight: new Float64Array(NORMAL_ROWS * NORMAL_COLUMNS),
  };
  for (let at = 0; at < size * size; at++) {
    if (!(mask[at] >= 0.5)) continue;
    const n = [normal[3 * at], normal[3 * at + 1], normal[3 * at + 2]];
    if (!(Math.hypot(...n) > 0)) continue;
    const x = ((at % size) + 0.5 - cx) / fx;
    const y = -(Math.floor(at / size) + 0.5 - cy) / fy;
    const length = Math.hypot(x, y, 1);
    const o = [-x / length, -y / length, 1 / length];
    const cosine = n[0] * o[0] + n[1] * o[1] + n[2] * o[2];
    if (!(cosine > LEAST_COSINE)) continue;
    if (Number.isFinite(mirror[at])) {
      const towards = n.map((value, axis) => 2 * cosine * value - o[axis]);
      const weight = mask[at] * cosine;
      const value = weight * Math.max(mirror[at], 0);
      splat(towards, ROWS, COLUMNS, value, evidence.mirror, weight, evidence.mirrorWeight);
    }
    if (Number.isFinite(shading[at])) {
      const value = mask[at] * shading[at];
      const [rows, columns] = [NORMAL_ROWS, NORMAL_COLUMNS];
      splat(n, rows, columns, value, evidence.diffuse, mask[at], evidence.diffuseWeight);
    }
  }
  return evidence;
}

/** Divide a value and its weight among the four texels nearest to a direction. */
function splat([x, y, z], rows, columns, value, values, weight, weights) {
  const across = (Math.atan2(x, -z) / (2 * Math.PI)) * columns - 0.5;
  const down = (Math.atan2(Math.hypot(x, z), y) / Math.PI) * rows - 0.5;
  const row = Math.min(Math.max(down, 0), rows - 1);
  const [left, top] = [Math.floor(across), Math.floor(row)];
  const bottom = Math.min(top + 1, rows - 1);
  const [rightShare, bottomShare] = [across - left, row - top];
  const first = (left + columns) % columns;
  const second = (left + 1 + columns) % columns;
  const add = (at, share) => {
    values[at] += value * share;
    weights[at] += weight * share;
  };
  add(top * columns + first, (1 - bottomShare) * (1 - rightShare));
  add(top * columns + second, (1 - bottomShare) * rightShare);
  add(bottom * columns + first, bottomShare * (1 - rightShare));
  add(bottom * columns + second, bottomShare * rightShare);
}

/** The mirrored light, and the share of each direction that was not seen. */
function filled(evidence) {
  const count = ROWS * COLUMNS;
  const unit = (2 * Math.PI ** 2) / count;
  const relative = (sums) => sums.map((value, at) => (value * unit) / SOLID_ANGLES[at]);
  const [mirror, mirrorWeight] = [relative(evidence.mirror), relative(evidence.mirrorWeight)];
  const light = new Float64Array(count);
  const unseen = new Float64Array(count).fill(1);
  for (const scale of SCALES) {
    const total = scale ? blurred(mirror, scale) : mirror;
    const weight = scale ? blurred(mirrorWeight, scale) : mirrorWeight;
    for (let at = 0; at < count; at++) {
      light[at] = (total[at] + TRUST * light[at]) / (weight[at] + TRUST);
      unseen[at] = (TRUST * unseen[at]) / (weight[at] + TRUST);
    }
  }
  return { light, unseen };
}

// Blurs on the sphere, as circular convolutions.

const blurs = new Map();

/** A map blurred by a Gaussian of `scale` texels, along the parallels, then the meridians. */
function blurred(radiance, scale) {
  if (!blurs.has(scale)) {
    const angle = (scale * Math.PI) / ROWS;
    const parallels = Array.from({ length: ROWS }, (_, row) =>
      kernel(COLUMNS, angle / (2 * Math.PI * Math.sin((Math.PI * (row + 0.5)) / ROWS))),
    );
    const meridian = kernel(2 * ROWS, angle / (2 * Math.PI));
    blurs.set(scale, { parallels, meridian, area: alongMeridians(SOLID_ANGLES, meridian) });
  }
  const { parallels, meridian, area } = blurs.get(scale);
  const energy = new Float64Array(ROWS * COLUMNS);
  for (let row = 0; row < ROWS; row++) {
    const weights = parallels[row];
    const start = row * COLUMNS;
    for (let from = 0; from < COLUMNS; from++) {
      const value = radiance[start + from] * SOLID_ANGLES[start + from];
      if (value === 0) continue;
      const shift = COLUMNS - from;
      for (let to = 0; to < COLUMNS; to++) energy[start + to] += value * weights[shift + to];
    }
  }
  return alongMeridians(energy, meridian).map((value, at) => Math.max(value / area[at], 0));
}

/** Behind the pole a meridian continues as the opposite meridian. */
function alongMeridians(energy, weights) {
  const out = new Float64Array(ROWS * COLUMNS);
  const half = COLUMNS / 2;
  for (let from = 0; from < 2 * ROWS; from++) {
    const start = COLUMNS * (from < ROWS ? from : 2 * ROWS - 1 - from);
    const [left, right] = from < ROWS ? [start, start + half] : [start + half, start];
    for (let to = 0; to < ROWS; to++) {
      const weight = weights[2 * ROWS - from + to];
      const line = to * COLUMNS;
      for (let column = 0; column < half; column++) {
        out[line + column] += weight * energy[left + column];
        out[line + half + column] += weight * energy[right + column];
      }
    }
  }
  return out;
}

/** The weights of `count` samples, twice in a row, of a Gaussian of deviation `share` × `count`. */
function kernel(count, share) {
  const response = Array.from({ length: count / 2 + 1 }, (_, frequency) =>
    Math.exp(-2 * (Math.PI * frequency * share) ** 2),
  );
  return Float64Array.from({ length: 2 * count }, (_, at) => {
    let sum = response[0] + response[count / 2] * (at % 2 ? -1 : 1);
    for (let frequency = 1; frequency < count / 2; frequency++) {
      sum += 2 * response[frequency] * Math.cos((2 * Math.PI * frequency * at) / count);
    }
    return sum / count;
  });
}

// Directions, solid angles, harmonics.

function directions(rows, columns) {
  const out = new Float64Array(3 * rows * columns);
  for (let at = 0; at < rows * columns; at++) {
    out.set(direction(Math.floor(at / columns), at % columns, columns, rows), 3 * at);
  }
  return out;
}

function solidAngles(rows, columns) {
  return Float64Array.from({ length: rows * columns }, (_, at) =>
    solidAngle(Math.floor(at / columns), columns, rows),
  );
}

const SOLID_ANGLES = solidAngles(ROWS, COLUMNS);
const NORMALS = directions(NORMAL_ROWS, NORMAL_COLUMNS);
const NORMAL_ANGLES = solidAngles(NORMAL_ROWS, NORMAL_COLUMNS);
const HARMONICS = harmonics(directions(ROWS, COLUMNS));
const NORMAL_HARMONICS = harmonics(NORMALS);

/** Nine real spherical harmonics of order 0 to 2 for each direction. */
function harmonics(direction) {
  const out = new Float64Array(3 * direction.length);
  const [first, second] = [Math.sqrt(0.75 / Math.PI), Math.sqrt(3.75 / Math.PI)];
  for (let at = 0; at < direction.length; at += 3) {
    const [x, y, z] = direction.subarray(at, at + 3);
    const row = [
      ...[0.5 / Math.sqrt(Math.PI), first * x, first * y, first * z],
      ...[second * x * y, second * y * z, second * z * x],
      Math.sqrt(0.3125 / Math.PI) * (3 * y * y - 1),
      Math.sqrt(0.9375 / Math.PI) * (z * z - x * x),
    ];
    out.set(row, 3 * at);
  }
  return out;
}

/** The light of order 2 whose D fits `values` in the directions `shaded` best, with a ridge. */
function lowFrequencies(values, weights, whole, shaded) {
  const matrix = Array.from({ length: 9 }, (_, row) =>
    Array.from({ length: 10 }, (_, column) => (row === column ? RIDGE : 0)),
  );
  shaded.forEach((direction, index) => {
    const basis = COSINE_LOBE.map((factor, at) => factor * NORMAL_HARMONICS[9 * direction + at]);
    for (let row = 0; row < 9; row++) {
      const share = (basis[row] * weights[index]) / whole;
      for (let column = 0; column < 9; column++) matrix[row][column] += share * basis[column];
      matrix[row][9] += share * values[index];
    }
  });
  const coefficients = solution(matrix);
  return Float64Array.from({ length: ROWS * COLUMNS }, (_, at) =>
    coefficients.reduce((sum, value, index) => sum + value * HARMONICS[9 * at + index], 0),
  );
}

/** Gauss–Jordan on a symmetric, positive definite matrix with its right-hand side beside it. */
function solution(matrix) {
  const count = matrix.length;
  for (let pivot = 0; pivot < count; pivot++) {
    const scaled = matrix[pivot].map((value) => value / matrix[pivot][pivot]);
    matrix[pivot] = scaled;
    for (let row = 0; row < count; row++) {
      if (row === pivot) continue;
      const factor = matrix[row][pivot];
      matrix[row] = matrix[row].map((value, column) => value - factor * scaled[column]);
    }
  }
  return matrix.map((row) => row[count]);
}

/** D of a light in the directions `shaded` of the map of normals. */
function shadingOf(light, shaded) {
  const energy = new Float64Array(NORMAL_ROWS * NORMAL_COLUMNS);
  light.forEach((value, at) => {
    const row = Math.floor(at / COLUMNS) >> 1;
    energy[row * NORMAL_COLUMNS + ((at % COLUMNS) >> 1)] += value * SOLID_ANGLES[at];
  });
  return shaded.map((direction) => cosineSum(direction, energy) / FURNACE[direction]);
}

/** The sum of values on the map of normals, weighted by their cosine to one of its directions. */
function cosineSum(direction, values) {
  const x = NORMALS[3 * direction];
  const y = NORMALS[3 * direction + 1];
  const z = NORMALS[3 * direction + 2];
  let sum = 0;
  for (let at = 0; at < values.length; at++) {
    const cosine = x * NORMALS[3 * at] + y * NORMALS[3 * at + 1] + z * NORMALS[3 * at + 2];
    if (cosine > 0) sum += cosine * values[at];
  }
  return sum;
}

// D of a light of 1, by direction of the normal, as sums over the texels give it.
const FURNACE = Float64Array.from({ length: NORMAL_ANGLES.length }, (_, direction) =>
  cosineSum(direction, NORMAL_ANGLES),
);
