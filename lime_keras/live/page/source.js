// Where pictures come from: the camera, a video, a photo. Each gives frames as ImageData, sRGB.

import { withProfile } from "./adobe_rgb.js";
import { LINEAR, toLevel } from "./colour.js";
import { EngineError } from "./errors.js";

const LONGEST = 4096;
const SMALLEST = 16;
const MOST_PIXELS = 50e6;
const PATIENCE = 15000; // ms until a camera or video has to give its first picture

/** A photo: one frame, and the mask that its transparency is. */
export class Still {
  live = false;

  constructor(name, image, mask) {
    Object.assign(this, { name, image, mask });
  }

  frame() {
    return this.image;
  }

  stop() {}
}

/** A photo from a file or Blob; `decode`, if there is one, reads what the browser cannot. */
export async function openPhoto(blob, name, decode) {
  let bitmap;
  try {
    bitmap = await createImageBitmap(await withProfile(blob));
  } catch {
    if (!decode) {
      throw new EngineError(`${name} cannot be read as a picture: try a JPEG or PNG of it.`);
    }
    bitmap = await createImageBitmap(await decode(blob));
  }
  const { width, height } = bitmap;
  if (Math.min(width, height) < SMALLEST) {
    throw new EngineError(
      `${name} has ${width}×${height} pixels, too few to show an object's shading: ` +
        `take one of at least ${SMALLEST}×${SMALLEST}.`,
    );
  }
  if (width * height > MOST_PIXELS) {
    const million = Math.round((width * height) / 1e6);
    throw new EngineError(`${name} has ${million} million pixels: make it smaller than 50 million.`);
  }
  const { image, mask } = reduced(bitmap);
  bitmap.close();
  return new Still(name, image, mask);
}

/**
 * A bitmap as ImageData over black, and its alpha as a mask or null. A bitmap longer than 4096
 * pixels is made smaller by a whole factor, in linear light: the browser's own scaling changes the
 * estimate.
 */
function reduced(bitmap, isStraight = false) {
  const factor = Math.ceil(Math.max(bitmap.width, bitmap.height) / LONGEST);
  if (factor === 1) return composed(bitmap);
  const [width, height] = [Math.floor(bitmap.width / factor), Math.floor(bitmap.height / factor)];
  const image = new ImageData(width, height);
  const alpha = new Uint8Array(width * height);
  // In strips, so that a large photo is never in memory as a canvas, too.
  const rows = Math.max(1, Math.floor(2e6 / (bitmap.width * factor)));
  const canvas = new OffscreenCanvas(bitmap.width, rows * factor);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  let [least, largest] = [255, 0];
  for (let top = 0; top < height; top += rows) {
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(bitmap, 0, -top * factor);
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    for (let row = top; row < Math.min(top + rows, height); row++) {
      for (let column = 0; column < width; column++) {
        const sums = [0, 0, 0, 0];
        for (let r = 0; r < factor; r++) {
          let at = 4 * (((row - top) * factor + r) * bitmap.width + column * factor);
          for (let c = 0; c < factor; c++, at += 4) {
            const opacity = isStraight ? 255 : data[at + 3];
            least = Math.min(least, opacity);
            largest = Math.max(largest, opacity);
            for (let k = 0; k < 3; k++) {
              sums[k] += LINEAR[opacity === 255 ? data[at + k] : Math.round((data[at + k] * opacity) / 255)];
            }
            sums[3] += opacity;
          }
        }
        const to = row * width + column;
        for (let k = 0; k < 3; k++) {
          image.data[4 * to + k] = toLevel(sums[k] / (factor * factor));
        }
        image.data[4 * to + 3] = 255;
        alpha[to] = Math.round(sums[3] / (factor * factor));
      }
    }
  }
  if (least === 255) return { image, mask: null };
  return masksObject(least, largest) ? { image, mask: alpha } : reduced(bitmap, true);
}

/** Whether alpha from `least` to `largest` masks an object, as in Python (`photo._alpha_of`). */
function masksObject(least, largest) {
  return largest >= 128 && least < largest;
}

/** A bitmap, pixel for pixel, as ImageData over black, and its alpha as a mask or null. */
function composed(bitmap) {
  const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  const image = context.getImageData(0, 0, bitmap.width, bitmap.height);
  const { data } = image;
  let [least, largest] = [255, 0];
  for (let at = 3; at < data.length; at += 4) {
    least = Math.min(least, data[at]);
    largest = Math.max(largest, data[at]);
  }
  const mask = masksObject(least, largest) ? new Uint8Array(data.length / 4) : null;
  for (let at = 3; least < 255 && at < data.length; at += 4) {
    if (mask) {
      mask[(at - 3) / 4] = data[at];
      for (let k = at - 3; k < at; k++) data[k] = Math.round((data[k] * data[at]) / 255);
    }
    data[at] = 255;
  }
  return { image, mask };
}

/** A camera or a video that plays: frames come one after the other. */
class Moving {
  live = true;
  mask = null;
  gone = false;
  #canvas = document.createElement("canvas");
  #context = this.#canvas.getContext("2d", { willReadFrequently: true });
  #fresh = true; // a frame has come since the last one was taken
  #wake = () => {};
  #stopped = false;

  constructor(name, video) {
    Object.assign(this, { name, video });
    const watch = () => {
      this.#fresh = true;
      this.#wake();
      if (this.#stopped) return;
      if (video.requestVideoFrameCallback) video.requestVideoFrameCallback(watch);
      else requestAnimationFrame(watch);
    };
    watch();
  }

  /** End, because the camera is gone. */
  lose() {
    this.gone = true;
    this.#fresh = false;
    this.#wake();
  }

  /** The newest frame that was not taken yet, once it is there; null if none comes for a second. */
  async next() {
    if (!this.#fresh && !this.gone) {
      await new Promise((resolve) => {
        const timer = setTimeout(resolve, 1000);
        this.#wake = () => {
          clearTimeout(timer);
          resolve();
        };
      });
    }
    if (!this.#fresh || this.gone) return null;
    this.#fresh = false;
    return this.frame();
  }

  frame() {
    const { videoWidth, videoHeight } = this.video;
    if (!videoWidth) return null;
    const scale = Math.min(1, LONGEST / Math.max(videoWidth, videoHeight));
    const [width, height] = [Math.round(videoWidth * scale), Math.round(videoHeight * scale)];
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      Object.assign(this.#canvas, { width, height });
    }
    this.#context.drawImage(this.video, 0, 0, width, height);
    return this.#context.getImageData(0, 0, width, height, { colorSpace: "srgb" });
  }

  stop() {
    this.#stopped = true;
    this.#wake();
    this.video.pause();
    for (const track of this.video.srcObject?.getTracks() ?? []) track.stop();
    this.video.srcObject = null;
    if (this.video.src) URL.revokeObjectURL(this.video.src);
    this.video.removeAttribute("src");
  }
}

/** The camera of this name (`deviceId`), or the rear one, or any. */
export async function openCamera(deviceId) {
  if (!navigator.mediaDevices?.getUserMedia) {
    throw new EngineError(
      "Browsers give the camera only to pages over HTTPS or from this computer: open the page as " +
        "https://… or http://localhost:…, or drop a photo here.",
    );
  }
  const which = deviceId ? { deviceId: { exact: deviceId } } : { facingMode: { ideal: "environment" } };
  let stream;
  try {
    stream = await navigator.mediaDevices.getUserMedia({
      audio: false,
      video: { ...which, width: { ideal: 640 }, height: { ideal: 480 }, frameRate: { ideal: 30 } },
    });
  } catch (error) {
    throw new EngineError(refusal(error));
  }
  const [track] = stream.getVideoTracks();
  const video = await playing((element) => (element.srcObject = stream)).catch(() => {
    for (const one of stream.getTracks()) one.stop();
    throw new EngineError("No picture arrives: is the camera covered, asleep or unplugged? Press Camera again.");
  });
  const source = new Moving(track.label || "camera", video);
  source.deviceId = track.getSettings().deviceId;
  track.addEventListener("ended", () => source.lose());
  return source;
}

function refusal({ name, message }) {
  switch (name) {
    case "NotAllowedError":
    case "SecurityError":
      return (
        "The camera was not allowed: click the camera sign beside the address, allow it, and press " +
        "Camera again; or drop a photo here."
      );
    case "NotFoundError":
    case "OverconstrainedError":
      return "No camera was found: plug one in and press Camera again, or drop a photo here.";
    case "NotReadableError":
    case "AbortError":
      return "Another program uses the camera: close it and press Camera again, or drop a photo here.";
    default:
      return `The camera cannot be opened (${message || name}): press Camera again, or drop a photo here.`;
  }
}

/** The cameras that the browser tells of: [{deviceId, label}], labels only once one was allowed. */
export async function cameras() {
  const devices = (await navigator.mediaDevices?.enumerateDevices?.()) ?? [];
  return devices.filter(({ kind }) => kind === "videoinput");
}

/** A video from a file or Blob, over and over. */
export async function openVideo(blob, name) {
  const address = URL.createObjectURL(blob);
  try {
    return new Moving(name, await playing((element) => (element.src = address)));
  } catch {
    URL.revokeObjectURL(address);
    throw new EngineError(`${name} cannot be played by this browser: export it as MP4 (H.264) or WebM.`);
  }
}

/** A playing element that has a picture; it fails if there is none, or only sound. */
async function playing(give) {
  const video = document.createElement("video");
  Object.assign(video, { muted: true, loop: true, playsInline: true });
  const loaded = new Promise((resolve, reject) => {
    video.addEventListener("loadeddata", resolve, { once: true });
    video.addEventListener("error", reject, { once: true });
    setTimeout(reject, PATIENCE);
  });
  give(video);
  // Phones load nothing before they play.
  await Promise.all([video.play(), loaded]);
  if (!video.videoWidth) throw new Error("it has no picture");
  return video;
}
