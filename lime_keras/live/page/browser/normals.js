// Normals guessed from a mask: lime_keras/lighting/guessed_normals.py.

const GRID = 96;
const RESIDUAL = 1e-5;

/** Unit normals, three numbers a pixel in camera space, of a dome over a mask; 0 outside. */
export function normals(mask, height, width) {
  const out = new Float32Array(3 * height * width);
  const box = { top: height, left: width, bottom: 0, right: 0 };
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      if (mask[row * width + column] < 0.5) continue;
      box.top = Math.min(box.top, row);
      box.left = Math.min(box.left, column);
      box.bottom = Math.max(box.bottom, row + 1);
      box.right = Math.max(box.right, column + 1);
    }
  }
  if (box.bottom === 0) return out;
  const [tall, wide] = [box.bottom - box.top, box.right - box.left];
  const cropped = new Float64Array(tall * wide);
  for (let row = 0; row < tall; row++) {
    for (let column = 0; column < wide; column++) {
      const covered = mask[(box.top + row) * width + box.left + column] >= 0.5;
      cropped[row * wide + column] = covered ? 1 : 0;
    }
  }
  const found = dome(cropped, tall, wide);
  for (let at = 0; at < tall * wide; at++) {
    if (!cropped[at]) continue;
    const to = 3 * ((box.top + Math.floor(at / wide)) * width + box.left + (at % wide));
    for (let axis = 0; axis < 3; axis++) out[to + axis] = found[axis][at];
  }
  return out;
}

/** The dome's normals, an array for each axis, over the mask's bounding box. */
function dome(inside, tall, wide) {
  const step = Math.max(1, Math.max(tall, wide) / GRID);
  const [rows, columns] = [tall, wide].map((side) => Math.max(1, roundHalfEven(side / step)));
  const means = resized(inside, tall, wide, areas(tall, rows), areas(wide, columns));
  const film = solved(Uint8Array.from(means, (share) => (share >= 0.5 ? 1 : 0)), rows, columns);
  const height = (row, column) =>
    row < 0 || column < 0 || row >= rows || column >= columns ? 0 : film[row * columns + column];
  const slopes = [0, 1, 2].map(() => new Float64Array(rows * columns));
  for (let row = 0, at = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++, at++) {
      slopes[0][at] = -(height(row, column + 1) - height(row, column - 1)) / 2;
      slopes[1][at] = (height(row + 1, column) - height(row - 1, column)) / 2;
      slopes[2][at] = 2 * Math.sqrt(Math.max(height(row, column), 0));
    }
  }
  const [down, across] = [tents(rows, tall), tents(columns, wide)];
  const vectors = slopes.map((part) => resized(part, rows, columns, down, across));
  for (let at = 0; at < tall * wide; at++) {
    const length = Math.hypot(vectors[0][at], vectors[1][at], vectors[2][at]);
    for (let axis = 0; axis < 3; axis++) {
      vectors[axis][at] = length > 1e-9 ? vectors[axis][at] / length : axis === 2 ? 1 : 0;
    }
  }
  return vectors;
}

function roundHalfEven(value) {
  const below = Math.floor(value);
  if (value - below !== 0.5) return Math.round(value);
  return below % 2 === 0 ? below : below + 1;
}

/** For each of `fewer` equal parts of a side of `count` samples, its samples and their shares. */
function areas(count, fewer) {
  return Array.from({ length: fewer }, (_, part) => {
    const [low, high] = [part * (count / fewer), (part + 1) * (count / fewer)];
    return weighted(count, (sample) =>
      Math.max((Math.min(high, sample + 1) - Math.max(low, sample)) * (fewer / count), 0),
    );
  });
}

/** For each of `more` samples along a side of `count`, the samples between which it lies. */
function tents(count, more) {
  return Array.from({ length: more }, (_, index) => {
    const position = ((index + 0.5) * count) / more - 0.5;
    const row = weighted(count, (sample) => Math.max(1 - Math.abs(sample - position), 0));
    const total = row.reduce((sum, [, weight]) => sum + weight, 0);
    return row.map(([sample, weight]) => [sample, weight / total]);
  });
}

function weighted(count, weight) {
  const row = [];
  for (let sample = 0; sample < count; sample++) {
    const value = weight(sample);
    if (value > 0) row.push([sample, value]);
  }
  return row;
}

/** A layer of `height` × `width` samples, resampled by the weights of its new rows and columns. */
function resized(layer, height, width, rows, columns) {
  const half = new Float64Array(height * columns.length);
  for (let row = 0; row < height; row++) {
    columns.forEach((weights, column) => {
      let sum = 0;
      for (const [sample, weight] of weights) sum += weight * layer[row * width + sample];
      half[row * columns.length + column] = sum;
    });
  }
  const out = new Float64Array(rows.length * columns.length);
  rows.forEach((weights, row) => {
    for (const [sample, weight] of weights) {
      for (let column = 0; column < columns.length; column++) {
        out[row * columns.length + column] += weight * half[sample * columns.length + column];
      }
    }
  });
  return out;
}

/** The height that solves ∇²h = −4 inside, and is 0 outside, by conjugate gradients. */
function solved(inside, rows, columns) {
  const wide = columns + 2; // A frame of zeros around.
  const cells = [];
  for (let at = 0; at < inside.length; at++) {
    if (inside[at]) cells.push((Math.floor(at / columns) + 1) * wide + (at % columns) + 1);
  }
  const [height, residual, applied] = [0, 1, 2].map(() => new Float64Array(wide * (rows + 2)));
  for (const at of cells) residual[at] = 4;
  const direction = residual.slice();
  const product = (one, other) => {
    let sum = 0;
    for (const at of cells) sum += one[at] * other[at];
    return sum;
  };
  let square = product(residual, residual);
  const enough = RESIDUAL ** 2 * square;
  while (square > enough) {
    for (const at of cells) {
      const around =
        direction[at - wide] + direction[at + wide] + direction[at - 1] + direction[at + 1];
      applied[at] = 4 * direction[at] - around;
    }
    const step = square / product(direction, applied);
    for (const at of cells) {
      height[at] += step * direction[at];
      residual[at] -= step * applied[at];
    }
    const before = square;
    square = product(residual, residual);
    for (const at of cells) direction[at] = residual[at] + (direction[at] * square) / before;
  }
  const out = new Float64Array(inside.length);
  for (let at = 0; at < out.length; at++) {
    out[at] = height[(Math.floor(at / columns) + 1) * wide + (at % columns) + 1];
  }
  return out;
}
