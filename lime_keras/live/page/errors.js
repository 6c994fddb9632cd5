// The errors that the page shows to its user.

/**
 * An error whose message says what to do.
 * `kind` is "frame" (this picture cannot be used), "busy" (try the next frame) or "gone" (the
 * engine is lost, and is looked for again).
 */
export class EngineError extends Error {
  constructor(message, kind = "frame") {
    super(message);
    this.name = "EngineError";
    this.kind = kind;
  }
}
