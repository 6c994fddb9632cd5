// The networks in a worker, so that the page never waits for them.
//
// Messages to it: {load: …} once, then {estimate: frame}, {restart: true} and {time: runs}. Each but
// the restart is answered by {done: …} or {failed: message}; while it loads, {progress: text}.

import { Session } from "./session.js";

let session = null;
let run = null;
let size = 0;

let last = Promise.resolve();

self.onmessage = ({ data }) => {
  last = last.then(() => answered(data)); // One after another.
};

async function answered(data) {
  try {
    if (data.load) self.postMessage({ done: await load(data.load) });
    else if (data.estimate) self.postMessage({ done: await session.answer(data.estimate) });
    else if (data.time) self.postMessage({ done: await timed(data.time) });
    else if (data.restart) session.restart();
  } catch (error) {
    self.postMessage({ failed: error?.message ?? String(error) });
  }
}

/** Load the runtime and the graphs; `base` is the address of the page's folder. */
async function load({ base, backend, threads, config }) {
  const { script, wasm, module, bytes } = config.runtime[backend];
  const files = [{ path: wasm, bytes }, ...Object.values(config.graphs)];
  const [binary, ...graphs] = await fetched(base, files);
  const ort = await import(new URL(script, base));
  ort.env.logLevel = "error";
  ort.env.wasm.numThreads = threads;
  ort.env.wasm.wasmPaths = { mjs: new URL(module, base).href };
  ort.env.wasm.wasmBinary = binary;
  const sessions = {};
  for (const [index, name] of Object.keys(config.graphs).entries()) {
    self.postMessage({ progress: `Opening the networks: ${name}` });
    sessions[name] = await ort.InferenceSession.create(graphs[index], {
      executionProviders: [backend],
      graphOptimizationLevel: "all",
    });
  }
  size = config.size;
  const shapes = { image: [1, size, size, 3], mask: [1, size, size, 1] };
  run = async (name, inputs) => {
    if (!(name in sessions)) return {};
    const feeds = {};
    for (const input of sessions[name].inputNames) {
      feeds[input] = new ort.Tensor("float32", inputs[input], shapes[input]);
    }
    const found = await sessions[name].run(feeds);
    const outputs = {};
    for (const [output, tensor] of Object.entries(found)) {
      outputs[output] = tensor.data.slice();
      shapes[output] = tensor.dims; // For a graph that reads it.
    }
    return outputs;
  };
  session = new Session(run, size);
  await timed(1); // The first run prepares buffers and shaders.
  return { threads: ort.env.wasm.numThreads };
}

/** The files' contents, told in megabytes while they come. */
async function fetched(base, files) {
  const whole = files.reduce((sum, { bytes }) => sum + bytes, 0);
  let got = 0;
  let told = -1;
  const one = async ({ path, bytes }) => {
    const answer = await fetch(new URL(path, base), { cache: "no-cache" }); // the page may have been exported anew
    if (!answer.ok) throw new Error(`${path} cannot be loaded (${answer.status}): load the page again`);
    const content = new Uint8Array(bytes);
    let at = 0;
    const reader = answer.body.getReader();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      if (at + value.length > bytes) throw new Error(`${path} is not the file of this page: export it again`);
      content.set(value, at);
      at += value.length;
      got += value.length;
      const megabytes = Math.round(got / 1e6);
      if (megabytes !== told) {
        told = megabytes;
        const text = `Loading the networks: ${told} of ${Math.round(whole / 1e6)} MB`;
        self.postMessage({ progress: text });
      }
    }
    if (at !== bytes) throw new Error(`${path} came incompletely: load the page again`);
    return content;
  };
  return Promise.all(files.map(one));
}

/** The mean time in ms of all networks on an empty picture. */
async function timed(runs) {
  const image = new Float32Array(3 * size * size);
  const mask = new Float32Array(size * size).fill(1);
  const begun = performance.now();
  for (let count = 0; count < runs; count++) {
    await run("mask", { image });
    const material = await run("material", { image, mask });
    await run("layers", { image, mask, ...material });
  }
  return (performance.now() - begun) / runs;
}
