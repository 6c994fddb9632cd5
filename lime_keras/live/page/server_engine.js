// The engine behind the local server: a frame goes out as bytes, its answer comes back as bytes.
// The form is that of lime_keras/live/wire.py.

import { EngineError } from "./errors.js";

const LARGEST = 80 * 2 ** 20; // bytes of a file that the server takes
const TYPES = { uint8: Uint8Array, float32: Float32Array };

export async function createEngine(config) {
  return new ServerEngine(config);
}

class ServerEngine {
  #restart = true;

  constructor(config) {
    this.name = "server";
    this.about = config.about;
    this.page = String(Math.random());
  }

  restart() {
    this.#restart = true;
  }

  async estimate({ number, image, mask, options }) {
    const { width, height } = image;
    const header = new TextEncoder().encode(
      JSON.stringify({
        page: this.page, number, width, height, mask: mask !== null, options, restart: this.#restart,
      }),
    );
    const length = new DataView(new ArrayBuffer(4));
    length.setUint32(0, header.length, true);
    const parts = [length.buffer, header, image.data, ...(mask ? [mask] : [])];
    // A source that begins while this frame is on its way asks for a restart of its own.
    const restarts = this.#restart;
    this.#restart = false;
    let buffer;
    try {
      buffer = await (await post("estimate", new Blob(parts))).arrayBuffer();
    } catch (error) {
      this.#restart ||= restarts;
      throw error;
    }
    const told = new DataView(buffer).getUint32(0, true);
    const { arrays, ...answer } = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, told)));
    const array = (name) => {
      if (!(name in arrays)) return null;
      const { type, shape, first } = arrays[name];
      const Kind = TYPES[type];
      const count = shape.reduce((product, side) => product * side, 1);
      const start = 4 + told + first;
      return new Kind(buffer.slice(start, start + count * Kind.BYTES_PER_ELEMENT));
    };
    const light = array("light");
    return {
      ...answer,
      material: answer.material ?? null,
      fused: answer.fused ?? null,
      layers: Object.fromEntries(
        ["mask", "specular_shading", "mirror"].map((name) => [name, array(name)]),
      ),
      light: light && { height: arrays.light.shape[0], width: arrays.light.shape[1], data: light },
    };
  }

  /** A PNG of a picture that the browser cannot read. */
  async decode(file) {
    const name = file.name || "the picture";
    if (file.size > LARGEST) {
      throw new EngineError(`${name} has more than 80 MiB: make it smaller, or a JPEG or PNG of it.`);
    }
    const bytes = await file.arrayBuffer().catch(() => {
      throw new EngineError(`${name} cannot be read: is it a folder, or was it moved? Choose it again.`);
    });
    const suffix = encodeURIComponent(/\.[^.]*$/.exec(name)?.[0] ?? "");
    for (;;) {
      try {
        return await (await post("decode", bytes, { "X-Suffix": suffix })).blob();
      } catch (error) {
        if (error.kind !== "busy") throw error;
        await new Promise((resolve) => setTimeout(resolve, 50));
      }
    }
  }
}

async function post(path, body, headers = {}) {
  let answer;
  try {
    answer = await fetch(path, {
      method: "POST",
      body,
      headers: { "Content-Type": "application/octet-stream", ...headers },
    });
  } catch {
    throw new EngineError(
      "The server has ended: start lime-live again. The page goes on by itself.",
      "gone",
    );
  }
  if (answer.ok) return answer;
  const { error, kind } = await answer.json().catch(() => ({}));
  throw new EngineError(error ?? `The server answered ${answer.status}.`, kind ?? "frame");
}
