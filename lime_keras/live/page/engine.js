// The choice of what estimates: the server that gave this page, or the browser itself.

import { EngineError } from "./errors.js";

/**
 * The engine that `engine.json`, beside the page, names, and that file's content.
 * `progress(text)` is called while it loads.
 */
export async function loadEngine(progress) {
  let config;
  try {
    const answer = await fetch("engine.json", { cache: "no-store" });
    if (!answer.ok) throw new EngineError(`engine.json: ${answer.status}`);
    config = await answer.json();
  } catch {
    throw new EngineError(
      "The page's server does not answer: start lime-live again. The page goes on by itself.",
      "gone",
    );
  }
  const module = await (config.engine === "server"
    ? import("./server_engine.js")
    : import("./browser/engine.js"));
  return { config, engine: await module.createEngine({ ...config, progress }) };
}
