// The picture side: the frame that an answer belongs to, its outline, its layers, and the brush.

import { toLevel } from "./colour.js";

/** The context of a canvas that is kept in main memory, from where all that is drawn here comes. */
export function levels(canvas) {
  return canvas.getContext("2d", { willReadFrequently: true });
}

/** The canvas of the frame, with the outline above it. */
export class View {
  constructor(frame, overlay) {
    this.frame = frame;
    this.overlay = overlay;
    this.image = null;
    this.answer = null;
    this.answered = null; // the last image that was answered, and its answer
    this.outlined = true;
    this.painted = null; // the mask under the brush, one byte a pixel of the frame
  }

  /** Show a frame without an answer yet, and so without an outline. */
  preview(image) {
    this.#draw(image);
    this.answer = null;
    this.outline();
  }

  #draw(image) {
    this.image = image;
    for (const canvas of [this.frame, this.overlay]) {
      if (canvas.width !== image.width || canvas.height !== image.height) {
        Object.assign(canvas, { width: image.width, height: image.height });
      }
    }
    levels(this.frame).putImageData(image, 0, 0);
  }

  /** Show a frame and its answer. */
  show(image, answer) {
    this.#draw(image);
    this.answer = answer;
    this.answered = { image, answer };
    this.outline();
  }

  /** Show the last frame that was answered again, if there is one. */
  back() {
    if (this.answered) this.show(this.answered.image, this.answered.answer);
  }

  outline() {
    const context = levels(this.overlay);
    const { width, height } = this.overlay;
    context.clearRect(0, 0, width, height);
    if (this.painted) {
      const tint = context.createImageData(width, height);
      for (let at = 0; at < this.painted.length; at++) {
        if (this.painted[at]) tint.data.set([163, 230, 53, 0.55 * this.painted[at]], 4 * at);
      }
      context.putImageData(tint, 0, 0);
      return;
    }
    if (!this.outlined || !this.answer?.found) return;
    const { square: [top, left, side], size, layers } = this.answer;
    const path = contour(layers.mask, size);
    const scale = side / size;
    // As wide on the screen whatever the frame's size.
    const line = Math.max(1, width / (this.overlay.clientWidth || width));
    context.save();
    context.translate(left, top);
    context.scale(scale, scale);
    for (const [colour, wide] of [["rgb(0 0 0 / 55%)", 4.5], ["rgb(190 242 100)", 2.25]]) {
      context.strokeStyle = colour;
      context.lineWidth = (wide * line) / scale;
      context.lineCap = "round";
      context.stroke(path);
    }
    context.restore();
  }

  /** Begin to mend the mask: what was found, at the frame's size. */
  beginPainting() {
    const { width, height } = this.image;
    this.painted = new Uint8Array(width * height);
    if (this.answer?.found) {
      const { square: [top, left, side], size, layers } = this.answer;
      for (let row = 0; row < height; row++) {
        const r = Math.floor(((row + 0.5 - top) * size) / side);
        if (r < 0 || r >= size) continue;
        for (let column = 0; column < width; column++) {
          const c = Math.floor(((column + 0.5 - left) * size) / side);
          if (c >= 0 && c < size && layers.mask[r * size + c] >= 128) {
            this.painted[row * width + column] = 255;
          }
        }
      }
    }
    this.outline();
  }

  /** Paint or erase from one point to another, both [x, y] in [0, 1]² of the frame. */
  paint(from, to, radius, value) {
    const { width, height } = this.image;
    const wide = Math.max(1, radius * Math.max(width, height));
    const steps = Math.max(
      1,
      Math.ceil((2 * Math.hypot((to[0] - from[0]) * width, (to[1] - from[1]) * height)) / wide),
    );
    for (let step = 0; step <= steps; step++) {
      const x = (from[0] + ((to[0] - from[0]) * step) / steps) * width;
      const y = (from[1] + ((to[1] - from[1]) * step) / steps) * height;
      for (let row = Math.max(0, Math.floor(y - wide)); row < Math.min(height, y + wide); row++) {
        for (let c = Math.max(0, Math.floor(x - wide)); c < Math.min(width, x + wide); c++) {
          if (Math.hypot(c + 0.5 - x, row + 0.5 - y) <= wide) this.painted[row * width + c] = value;
        }
      }
    }
    this.outline();
  }
}

/** The contour of a mask `size`² of bytes at one half, in the layer's pixels, as a Path2D. */
export function contour(mask, size) {
  const path = new Path2D();
  for (const [a, b] of segments(mask, size)) {
    path.moveTo(...a);
    path.lineTo(...b);
  }
  return path;
}

/** The pieces [[x, y], [x, y]] of a mask's contour (marching squares, with 0 around the mask). */
export function segments(mask, size) {
  const level = 127.5;
  const at = (row, column) =>
    row < 0 || column < 0 || row >= size || column >= size ? 0 : mask[row * size + column];
  const out = [];
  for (let row = -1; row < size; row++) {
    for (let column = -1; column < size; column++) {
      const corners = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
      const inside = corners.map((value) => value > level);
      if (inside.every((value) => value === inside[0])) continue;
      // Where the contour crosses the cell's four sides, clockwise from the top.
      const share = (k) => (level - corners[k]) / (corners[(k + 1) % 4] - corners[k]);
      const [x, y] = [column + 0.5, row + 0.5];
      const crossings = [
        () => [x + share(0), y],
        () => [x + 1, y + share(1)],
        () => [x + 1 - share(2), y + 1],
        () => [x, y + 1 - share(3)],
      ];
      const points = [0, 1, 2, 3].filter((k) => inside[k] !== inside[(k + 1) % 4]).map((k) => crossings[k]());
      for (let k = 0; k + 1 < points.length; k += 2) out.push([points[k], points[k + 1]]);
    }
  }
  return out;
}

/** Draw a layer of linear radiance, bright parts compressed, on a canvas. */
export function drawLayer(canvas, layer, size) {
  if (canvas.width !== size) Object.assign(canvas, { width: size, height: size });
  const image = new ImageData(size, size);
  for (let at = 0; at < size * size; at++) {
    const value = Math.max(layer?.[at] ?? 0, 0);
    image.data.fill(toLevel(value / (1 + value)), 4 * at, 4 * at + 3);
    image.data[4 * at + 3] = 255;
  }
  levels(canvas).putImageData(image, 0, 0);
}
