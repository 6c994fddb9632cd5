// The picture side: the frame that an answer belongs to, its outline, its layers, and the brush.

import { inside } from "./browser/framing.js";
import { toLevel } from "./colour.js";

const LEVEL = 127.5; // of a mask's bytes at the outline
const TINT = 0x8c35e6a3; // of the brush: opacity, blue, green, red
const LEAST_SECOND = 0.4; // of the frame's shorter side: the second object's, beside the first
const SMALLER = 0.75; // of its size, below which the second object takes the place of the first
const CLEARLY = 1.3; // times as much room, for which the second object changes sides

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
    this.second = null; // a square picture of the second object, to be shown beside the first
    this.onRight = true; // of the first
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
      const pixels = new Uint32Array(tint.data.buffer); // at once: a photo has millions
      for (let at = 0; at < pixels.length; at++) if (this.painted[at]) pixels[at] = TINT;
      context.putImageData(tint, 0, 0);
      return;
    }
    if (!this.answer?.found) return;
    if (this.outlined) this.#drawOutline(context);
    if (this.second) this.#drawSecond(context);
  }

  #drawOutline(context) {
    const { square: [top, left, side], size, layers } = this.answer;
    const path = contour(layers.mask, size);
    const scale = side / size;
    // As wide on the screen whatever the frame's size.
    const { width, clientWidth } = this.overlay;
    const line = Math.max(1, width / (clientWidth || width));
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

  /** Show the object of a canvas in the picture, beside the first or over it; null takes it away. */
  beside(canvas) {
    this.second = canvas && drawnPart(canvas);
    if (this.image) this.outline();
  }

  #drawSecond(context) {
    const { width, height } = this.overlay;
    const { left, top, side, onRight } = placeBeside(box(this.answer), width, height, this.onRight);
    this.onRight = onRight;
    const scale = side / Math.max(this.second.width, this.second.height);
    const [wide, high] = [scale * this.second.width, scale * this.second.height];
    context.imageSmoothingQuality = "high";
    context.drawImage(this.second, left + (side - wide) / 2, top + (side - high) / 2, wide, high);
  }

  /** Begin to mend the mask: what was found, at the frame's size. */
  beginPainting() {
    const { width, height } = this.image;
    this.painted = new Uint8Array(width * height);
    if (this.answer?.found) {
      const { square: [top, left, side], size, layers } = this.answer;
      this.painted = inside(layers.mask, size, { top, left, side }, height, width, LEVEL);
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

/** The box {left, top, right, bottom} in the frame of the object of an answer. */
function box({ square: [top, left, side], size, layers }) {
  const found = { left: Infinity, top: Infinity, right: -Infinity, bottom: -Infinity };
  layers.mask.forEach((value, at) => {
    if (value < LEVEL) return;
    const [row, column] = [Math.floor(at / size), at % size];
    found.left = Math.min(found.left, column);
    found.right = Math.max(found.right, column + 1);
    found.top = Math.min(found.top, row);
    found.bottom = Math.max(found.bottom, row + 1);
  });
  const scale = side / size;
  return {
    left: left + scale * found.left,
    right: left + scale * found.right,
    top: top + scale * found.top,
    bottom: top + scale * found.bottom,
  };
}

/** The part of a canvas that is drawn on, to a 64th of its size, as a canvas; null of an empty one. */
function drawnPart(canvas) {
  const steps = 64;
  const small = new OffscreenCanvas(steps, steps).getContext("2d", { willReadFrequently: true });
  small.drawImage(canvas, 0, 0, steps, steps);
  const { data } = small.getImageData(0, 0, steps, steps);
  const drawn = [...Array(steps * steps).keys()].filter((at) => data[4 * at + 3] > 0);
  if (!drawn.length) return null;
  const [columns, rows] = [drawn.map((at) => at % steps), drawn.map((at) => Math.floor(at / steps))];
  const ends = (places, size) => {
    const low = Math.floor((Math.min(...places) * size) / steps);
    return [low, Math.ceil(((Math.max(...places) + 1) * size) / steps) - low];
  };
  const [left, width] = ends(columns, canvas.width);
  const [top, height] = ends(rows, canvas.height);
  const part = new OffscreenCanvas(width, height);
  part.getContext("2d").drawImage(canvas, -left, -top);
  return part;
}

/**
 * The square {left, top, side} in a frame for the second object, as large as the box of the first:
 * beside it, or in its place where it would have to be much smaller. It stays on its side,
 * `onRight`, unless the other has clearly more room.
 */
export function placeBeside(first, width, height, onRight) {
  const least = LEAST_SECOND * Math.min(width, height);
  const rooms = [first.left, width - first.right];
  const right = rooms[Number(!onRight)] > CLEARLY * rooms[Number(onRight)] ? !onRight : onRight;
  const extent = Math.max(first.right - first.left, first.bottom - first.top, least);
  const whole = Math.min(extent, height, width);
  const within = (low, whole, side) => Math.min(Math.max(low, 0), whole - side);
  const side = Math.min(whole, rooms[Number(right)]);
  const middle = (first.top + first.bottom) / 2;
  if (side < SMALLER * whole) {
    return {
      left: within((first.left + first.right - whole) / 2, width, whole),
      top: within(middle - whole / 2, height, whole),
      side: whole,
      onRight: right,
    };
  }
  const left = right ? first.right : first.left - side;
  return { left, top: within(middle - side / 2, height, side), side, onRight: right };
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
  const at = (row, column) =>
    row < 0 || column < 0 || row >= size || column >= size ? 0 : mask[row * size + column];
  const out = [];
  for (let row = -1; row < size; row++) {
    for (let column = -1; column < size; column++) {
      const corners = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
      const inside = corners.map((value) => value > LEVEL);
      if (inside.every((value) => value === inside[0])) continue;
      // Where the contour crosses the cell's four sides, clockwise from the top.
      const share = (k) => (LEVEL - corners[k]) / (corners[(k + 1) % 4] - corners[k]);
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
