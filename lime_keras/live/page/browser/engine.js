// The engine of the page without Python: ONNX Runtime in a worker of the browser.

import { EngineError } from "../errors.js";

const BASE = new URL("../", import.meta.url).href;
const RUNS = 5; // Runs by which the two backends are compared.
const PATIENCE = 20000; // Milliseconds after which a backend that does not answer is too slow.
const MOST_THREADS = 4; // More threads gain networks this small nothing.

/**
 * Start the engine: in WebAssembly; and, if there is a graphics processor, in WebGPU as soon as
 * that was measured to be faster.
 */
export async function createEngine(config) {
  const engine = new BrowserEngine(config);
  try {
    await engine.start();
  } catch (error) {
    throw new EngineError(`The networks cannot be started: ${error.message}.`);
  }
  return engine;
}

class BrowserEngine {
  constructor(config) {
    this.name = "browser";
    this.config = config;
    this.worker = null;
    this.next = null; // The worker to go over to with the next frame.
  }

  get about() {
    return this.worker?.about ?? "WebAssembly";
  }

  async start() {
    const threads = self.crossOriginIsolated
      ? Math.min(navigator.hardwareConcurrency || 1, MOST_THREADS)
      : 1;
    const worker = new NetworkWorker("wasm", threads, this.config);
    try {
      await worker.ready;
    } catch (error) {
      worker.end();
      throw error;
    }
    this.worker = worker;
    this.compared = this.compare(worker);
  }

  /** Prepare a worker in WebGPU if it is faster than `worker`. */
  async compare(worker) {
    if (!(await hasGraphicsProcessor())) return;
    const other = new NetworkWorker("webgpu", 1, this.config);
    try {
      await within(PATIENCE, other.ready);
      const its = await within(PATIENCE, other.ask({ time: RUNS }));
      const own = await within(PATIENCE, worker.ask({ time: RUNS }));
      if (its < own && this.worker === worker) {
        this.next = other;
        return;
      }
    } catch (error) {
      console.info(`WebGPU is not used: ${error.message}`);
    }
    other.end();
  }

  async estimate(frame) {
    const { number, mask, options } = frame;
    const { width, height, data } = frame.image;
    const image = { width, height, data };
    try {
      if (this.worker === null) await this.start();
      if (this.next !== null) {
        this.worker.end();
        [this.worker, this.next] = [this.next, null];
      }
      return await this.worker.ask({ estimate: { number, image, mask, options } });
    } catch (error) {
      // A graphics processor that is lost fails each frame: then WebAssembly tells whose fault it is.
      const sound = this.worker?.lost === false && this.worker.about !== "WebGPU";
      if (sound) throw new EngineError(error.message);
      this.worker?.end();
      this.worker = null;
      throw new EngineError(`The networks stopped: ${error.message}. They are started again.`, "gone");
    }
  }

  restart() {
    this.worker?.tell({ restart: true });
  }
}

/** A worker with loaded networks, which answers one question after another. */
class NetworkWorker {
  constructor(backend, threads, config) {
    this.waiting = [];
    this.lost = false;
    this.worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
    this.worker.onmessage = ({ data }) => {
      if (data.progress) config.progress?.(data.progress);
      else if ("failed" in data) this.waiting.shift()?.reject(new Error(data.failed));
      else this.waiting.shift()?.resolve(data.done);
    };
    this.worker.onerror = (event) => {
      this.lost = true;
      event.preventDefault();
      const error = new Error(event.message || "the worker cannot be started");
      for (const { reject } of this.waiting.splice(0)) reject(error);
    };
    const { size, runtime, graphs } = config;
    const loaded = { base: BASE, backend, threads, config: { size, runtime, graphs } };
    this.ready = this.ask({ load: loaded }).then((told) => {
      const count = told.threads === 1 ? "1 thread" : `${told.threads} threads`;
      this.about = backend === "webgpu" ? "WebGPU" : `WebAssembly, ${count}`;
    });
  }

  ask(question) {
    if (this.lost) return Promise.reject(new Error("the worker was lost"));
    return new Promise((resolve, reject) => {
      this.waiting.push({ resolve, reject });
      this.worker.postMessage(question);
    });
  }

  tell(message) {
    this.worker.postMessage(message);
  }

  end() {
    this.worker.terminate();
  }
}

/**
 * Whether there is a graphics processor, and a browser that can wait for it (JSPI). A driver that
 * imitates one on the processor is none.
 */
async function hasGraphicsProcessor() {
  if (!("Suspending" in WebAssembly)) return false;
  const adapter = await navigator.gpu?.requestAdapter().catch(() => null);
  if (!adapter) return false;
  const { info } = adapter;
  const imitated = info?.isFallbackAdapter ?? adapter.isFallbackAdapter;
  return !imitated && !/swiftshader|llvmpipe/i.test(`${info?.architecture} ${info?.description}`);
}

function within(milliseconds, promise) {
  const late = new Promise((_, reject) => {
    setTimeout(() => reject(new Error("it takes too long")), milliseconds);
  });
  return Promise.race([promise, late]);
}
