// The square of a photo that the networks see: lime_keras/estimate/framing.py, whose numbers these
// functions give. A canvas does not: it averages sRGB levels, not light.
//
// A photo is an ImageData. A square is {top, left, side} in pixels of the photo, and may reach
// beyond it. Masks and layers are Float32Arrays, row by row.

import { LINEAR, toSrgb } from "../colour.js";

const FILL = 0.73;
const SMALLEST_FILL = 0.5;
const LARGEST_FILL = 0.9;
export const THRESHOLD = 0.5;

/** The smallest square that contains a whole photo, with the photo in its middle. */
export function whole(height, width) {
  const side = Math.max(height, width);
  return {
    top: -Math.floor((side - height) / 2) || 0,
    left: -Math.floor((side - width) / 2) || 0,
    side,
  };
}

/**
 * The square for a closer view of the largest object in a mask of `size` × `size` pixels; `square`
 * itself if there is no object, or if it fills half of the side.
 */
export function around(mask, size, square) {
  const box = largestObject(mask, size);
  if (box === null) return square;
  const extent = Math.max(box.bottom - box.top, box.right - box.left);
  if (extent >= SMALLEST_FILL * size) return square;
  return centred(box, extent, square, square.side / size);
}

/**
 * The square in which to look for an object in the next frame of a stream; null if the mask shows
 * no object, or one that reaches the square's edge where the frame goes on, or has outgrown it.
 */
export function following(mask, size, square, height, width) {
  const box = largestObject(mask, size);
  if (box === null) return null;
  const everything = whole(height, width);
  const isWhole = square.side === everything.side && square.top === everything.top && square.left === everything.left;
  const extent = Math.max(box.bottom - box.top, box.right - box.left);
  const cutOff =
    (box.top < 1 && square.top > 0) ||
    (box.left < 1 && square.left > 0) ||
    (box.bottom > size - 1 && square.top + square.side < height) ||
    (box.right > size - 1 && square.left + square.side < width);
  if (!isWhole && (cutOff || extent > LARGEST_FILL * size)) return null;
  const closer = centred(box, extent, square, square.side / size);
  return closer.side < (SMALLEST_FILL / FILL) * everything.side ? closer : everything;
}

/** The square around all that a mask of a photo's own size covers. */
export function aroundGiven(mask, height, width) {
  const box = { top: height, left: width, bottom: 0, right: 0 };
  for (let row = 0, at = 0; row < height; row++) {
    for (let column = 0; column < width; column++, at++) {
      if (mask[at] >= THRESHOLD) grow(box, row, column);
    }
  }
  const square = whole(height, width);
  if (box.bottom === 0) return square;
  const extent = Math.max(box.bottom - box.top, box.right - box.left);
  return centred(box, extent, { top: 0, left: 0, side: square.side }, 1);
}

function centred(box, extent, square, scale) {
  const side = Math.max(1, roundHalfEven((extent * scale) / FILL));
  const start = (origin, low, high) =>
    roundHalfEven(origin + ((low + high) / 2) * scale - side / 2) || 0;
  return {
    top: start(square.top, box.top, box.bottom),
    left: start(square.left, box.left, box.right),
    side,
  };
}

/** Round as Python does: halves to the even number. */
export function roundHalfEven(value) {
  const below = Math.floor(value);
  if (value - below !== 0.5) return Math.round(value);
  return below % 2 === 0 ? below : below + 1;
}

function grow(box, row, column) {
  box.top = Math.min(box.top, row);
  box.left = Math.min(box.left, column);
  box.bottom = Math.max(box.bottom, row + 1);
  box.right = Math.max(box.right, column + 1);
}

/** The box of the object of most pixels, joined along edges; of two as large, the first. */
function largestObject(mask, size) {
  const open = Uint8Array.from(mask, (value) => (value >= THRESHOLD ? 1 : 0));
  const stack = new Int32Array(open.length);
  let largest = null;
  let most = 0;
  for (let start = 0; start < open.length; start++) {
    if (!open[start]) continue;
    const box = { top: size, left: size, bottom: 0, right: 0 };
    let pixels = 0;
    let depth = 0;
    const visit = (at) => {
      open[at] = 0;
      stack[depth++] = at;
    };
    visit(start);
    while (depth > 0) {
      const at = stack[--depth];
      const row = Math.floor(at / size);
      const column = at % size;
      pixels++;
      grow(box, row, column);
      if (row > 0 && open[at - size]) visit(at - size);
      if (row < size - 1 && open[at + size]) visit(at + size);
      if (column > 0 && open[at - 1]) visit(at - 1);
      if (column < size - 1 && open[at + 1]) visit(at + 1);
    }
    if (pixels > most) [most, largest] = [pixels, box];
  }
  return largest;
}

/**
 * Resample a square of a photo to `size` × `size` pixels of three channels, sRGB in [0, 1]: areas
 * averaged in linear light, or interpolated if the square is the smaller one. Beyond the photo its
 * edge is repeated.
 */
export function cut(photo, square, size) {
  const { data, width, height } = photo;
  const out = new Float32Array(size * size * 3);
  if (square.side === size) {
    for (let row = 0, to = 0; row < size; row++) {
      const line = clamped(square.top + row, height) * width;
      for (let column = 0; column < size; column++) {
        const from = 4 * (line + clamped(square.left + column, width));
        for (let channel = 0; channel < 3; channel++) out[to++] = data[from + channel] / 255;
      }
    }
    return out;
  }
  const columns = taps(square.side, size);
  const rows = taps(square.side, size);
  const sources = columns.map(({ first, weights }) =>
    weights.map((_, tap) => 4 * clamped(square.left + clamped(first + tap, square.side), width)),
  );
  const [lowest, highest] = extremes(photo, square);
  const lines = new Map(); // Rows of the photo, resampled to `size` columns.
  const resampled = (line) => {
    if (!lines.has(line)) {
      const result = new Float32Array(size * 3);
      const start = 4 * line * width;
      for (let column = 0; column < size; column++) {
        const { weights } = columns[column];
        let [red, green, blue] = [0, 0, 0];
        for (let tap = 0; tap < weights.length; tap++) {
          const from = start + sources[column][tap];
          const weight = weights[tap];
          red += weight * LINEAR[data[from]];
          green += weight * LINEAR[data[from + 1]];
          blue += weight * LINEAR[data[from + 2]];
        }
        result.set([red, green, blue], 3 * column);
      }
      lines.set(line, result);
    }
    return lines.get(line);
  };
  const sum = new Float64Array(size * 3);
  for (let row = 0; row < size; row++) {
    sum.fill(0);
    const { first, weights } = rows[row];
    for (let tap = 0; tap < weights.length; tap++) {
      const line = resampled(clamped(square.top + clamped(first + tap, square.side), height));
      const weight = weights[tap];
      for (let at = 0; at < sum.length; at++) sum[at] += weight * line[at];
    }
    for (let at = 0; at < sum.length; at++) {
      const level = toSrgb(sum[at]);
      out[row * size * 3 + at] = Math.min(Math.max(level, lowest), highest);
    }
  }
  return out;
}

/**
 * Resample a square of a linear layer of one channel, such as a mask, to `size` × `size` pixels.
 * Beyond the layer's edges the result is 0.
 */
export function cutLayer(layer, height, width, square, size) {
  const along = square.side === size ? null : taps(square.side, size);
  const value = (row, column) => {
    const [down, across] = [square.top + row, square.left + column];
    return down < 0 || across < 0 || down >= height || across >= width
      ? 0
      : layer[down * width + across];
  };
  const out = new Float32Array(size * size);
  for (let row = 0; row < size; row++) {
    for (let column = 0; column < size; column++) {
      let sum = 0;
      if (along === null) {
        sum = value(row, column);
      } else {
        along[row].weights.forEach((down, i) => {
          const line = clamped(along[row].first + i, square.side);
          along[column].weights.forEach((across, j) => {
            sum += down * across * value(line, clamped(along[column].first + j, square.side));
          });
        });
      }
      out[row * size + column] = sum;
    }
  }
  return out;
}

/**
 * The pixels of a photo, 255 or 0, where a mask of `size` × `size` samples in a square reaches a
 * threshold: interpolated linearly in the square, and 0 beyond it.
 */
export function inside(mask, size, square, height, width, threshold = THRESHOLD) {
  const out = new Uint8Array(height * width);
  const columns = samples(square.left, square.side, size, width);
  const rows = samples(square.top, square.side, size, height);
  const lines = new Float64Array(size * width); // The mask's rows, as wide as the photo.
  for (const { pixel, first, weights } of columns) {
    for (let row = 0; row < size; row++) {
      let sum = 0;
      for (let k = 0; k < weights.length; k++) sum += weights[k] * mask[row * size + first + k];
      lines[row * width + pixel] = sum;
    }
  }
  for (const { pixel, first, weights } of rows) {
    for (const { pixel: column } of columns) {
      let sum = 0;
      for (let k = 0; k < weights.length; k++) sum += weights[k] * lines[(first + k) * width + column];
      if (sum >= threshold) out[pixel * width + column] = 255;
    }
  }
  return out;
}

/**
 * The pixels along a side of a photo that a square covers, with the samples from `first` on that
 * each is interpolated from, and their weights: a tent over two samples, or over two pixels if the
 * samples are finer.
 */
function samples(origin, side, size, extent) {
  const reach = Math.max(1, size / side);
  const out = [];
  for (let pixel = Math.max(0, origin); pixel < Math.min(extent, origin + side); pixel++) {
    const position = ((pixel - origin + 0.5) * size) / side - 0.5;
    const first = Math.max(0, Math.floor(position - reach) + 1);
    const last = Math.min(size - 1, Math.ceil(position + reach) - 1);
    const tent = Array.from({ length: last - first + 1 }, (_, k) =>
      Math.max(1 - Math.abs(first + k - position) / reach, 0),
    );
    const total = tent.reduce((sum, weight) => sum + weight, 0);
    out.push({ pixel, first, weights: tent.map((weight) => weight / total) });
  }
  return out;
}

/** Which of `size` × `size` samples of a square have their middle inside the photo. */
export function insidePhoto(square, height, width, size) {
  const within = (origin, index, extent) => {
    const middle = origin + ((index + 0.5) * square.side) / size;
    return middle >= 0 && middle <= extent;
  };
  return Array.from(
    { length: size * size },
    (_, at) =>
      within(square.top, Math.floor(at / size), height) && within(square.left, at % size, width),
  );
}

function clamped(at, count) {
  return Math.min(Math.max(at, 0), count - 1);
}

/** The lowest and the highest level, in [0, 1], of the part of a photo that a square shows. */
function extremes({ data, width, height }, square) {
  const rows = [clamped(square.top, height), clamped(square.top + square.side - 1, height)];
  const columns = [clamped(square.left, width), clamped(square.left + square.side - 1, width)];
  let [lowest, highest] = [255, 0];
  for (let row = rows[0]; row <= rows[1]; row++) {
    const stop = 4 * (row * width + columns[1]);
    for (let at = 4 * (row * width + columns[0]); at <= stop; at += 4) {
      for (let channel = 0; channel < 3; channel++) {
        const level = data[at + channel];
        if (level < lowest) lowest = level;
        if (level > highest) highest = level;
      }
    }
  }
  return [lowest / 255, highest / 255];
}

/**
 * The source pixels, from `first` on, and their weights, of each of `size` pixels that `side` pixels
 * become. They are OpenImageIO's, in its single precision, which decides about a source pixel on
 * the edge of two areas: a box of one new pixel, or a tent over two source pixels.
 */
function taps(side, size) {
  const single = Math.fround;
  const ratio = single(size / side);
  const smaller = side > size;
  const reach = smaller ? 0.5 : ratio;
  const radius = Math.ceil(single(reach / ratio));
  const pixel = single(1 / size);
  return Array.from({ length: size }, (_, at) => {
    const centre = single(single(single(at + 0.5) * pixel) * side);
    const nearest = Math.floor(centre);
    const beyond = single(single(centre - nearest) - 0.5);
    let weights = Array.from({ length: 2 * radius + 1 }, (_, tap) => {
      const distance = Math.abs(single(ratio * single(tap - radius - beyond)));
      if (smaller) return distance <= reach ? 1 : 0;
      return Math.max(1 - distance / reach, 0);
    });
    const total = weights.reduce((sum, weight) => sum + weight, 0);
    let first = 0;
    let last = weights.length - 1;
    while (weights[first] === 0) first++;
    while (weights[last] === 0) last--;
    weights = weights.slice(first, last + 1).map((weight) => weight / total);
    return { first: nearest - radius + first, weights };
  });
}
