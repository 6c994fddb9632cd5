// The contrast that a light loses to guessed normals: lime_keras/lighting/guessed_light.py.

import { direction, solidAngle } from "../panorama.js";
import { normaliser } from "../shading.js";

const SHARPNESS = 8;
const MOST_LAMPS = 0.8;
const NORMALS = 128;
const [ROWS, COLUMNS] = [32, 64];

/**
 * A light, 2 ROWS × 2 COLUMNS, under which the object is as bright, and varies as much, as it is
 * seen. `normals` has three numbers and `brightness` one for each of the object's pixels.
 */
export function withContrast(light, normals, brightness, material) {
  const { diffuse_albedo: diffuse, specular_albedo: specular, exponent } = material;
  const count = brightness.length;
  if (!count) return light;
  const most = light.reduce((largest, value) => Math.max(largest, value), 1e-30);
  const lamps = light.map((value) => (value / most) ** SHARPNESS);
  const picked = Array.from({ length: NORMALS }, (_, at) => {
    const pixel = Math.floor(((at + 0.5) * count) / NORMALS);
    return normals.subarray(3 * pixel, 3 * pixel + 3);
  });
  const grey = (diffuse[0] + diffuse[1] + diffuse[2]) / 3;
  const shaded = shadings([light, lamps], picked, exponent);
  const [even, peaked] = shaded.map((list) => list.map(([d, s]) => grey * d + specular * s));
  const [target, evenMean, peakedMean] = [mean(brightness), mean(even), mean(peaked)];
  if (!(evenMean > 0 && peakedMean > 0 && target > 0)) return light;
  const [evenGain, lampGain] = [target / evenMean, target / peakedMean];
  const share = shareOf(
    even.map((value) => value * evenGain),
    peaked.map((value) => value * lampGain),
    covariance(brightness, brightness),
  );
  return light.map(
    (value, at) => (1 - share) * evenGain * value + share * lampGain * lamps[at],
  );
}

/** The least w in [0, MOST_LAMPS] for which (1 − w) · even + w · peaked has a variance. */
function shareOf(even, peaked, variance) {
  const step = peaked.map((value, at) => value - even[at]);
  const a = covariance(step, step);
  const b = covariance(even, step);
  const c = covariance(even, even);
  if (c >= variance) return 0;
  if (!(a > 0)) return MOST_LAMPS;
  return Math.min((Math.sqrt(b * b + a * (variance - c)) - b) / a, MOST_LAMPS);
}

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function covariance(first, second) {
  const [one, other] = [mean(first), mean(second)];
  return first.reduce((sum, value, at) => sum + (value - one) * (second[at] - other), 0) / first.length;
}

/** For each light, [D, S] of each normal, for a viewer far away. */
function shadings(lights, normals, exponent) {
  const factor = normaliser(exponent);
  const energies = lights.map(energyOf);
  const rows = normals.map((n) => {
    const sums = energies.map(() => [0, 0]);
    for (let at = 0; at < DIRECTIONS.length; at++) {
      const [x, y, z] = DIRECTIONS[at];
      const cosine = n[0] * x + n[1] * y + n[2] * z;
      if (!(cosine > 0)) continue;
      const half = Math.max((cosine + n[2]) / Math.max(Math.hypot(x, y, z + 1), 1e-6), 0);
      const lobe = factor * half ** exponent;
      for (let light = 0; light < energies.length; light++) {
        sums[light][0] += (cosine / Math.PI) * energies[light][at];
        sums[light][1] += lobe * energies[light][at];
      }
    }
    return sums;
  });
  return energies.map((_, light) => rows.map((sums) => sums[light]));
}

/** The energy of each ROWS × COLUMNS cell: four texels' radiance times their solid angles. */
function energyOf(light) {
  const out = new Float64Array(ROWS * COLUMNS);
  for (let at = 0; at < light.length; at++) {
    const [row, column] = [Math.floor(at / (2 * COLUMNS)), at % (2 * COLUMNS)];
    const cell = (row >> 1) * COLUMNS + (column >> 1);
    out[cell] += light[at] * solidAngle(row, 2 * COLUMNS, 2 * ROWS);
  }
  return out;
}

const DIRECTIONS = Array.from({ length: ROWS * COLUMNS }, (_, at) =>
  direction(Math.floor(at / COLUMNS), at % COLUMNS, COLUMNS, ROWS),
);
