// The page: sources on one side, the engine in the middle, what it found on both sides.

import { css, hex } from "./colour.js";
import { loadEngine } from "./engine.js";
import { EngineError } from "./errors.js";
import { download, gltf, gltfMaterial } from "./exports.js";
import { describe, inNumbers, interval, probability } from "./gloss.js";
import { parse } from "./meshes.js";
import { picture, studio, turned } from "./panorama.js";
import { Renderer, TABLE } from "./renderer.js";
import { knot, sphere, teapot } from "./shapes.js";
import { cameras, openCamera, openPhoto, openVideo } from "./source.js";
import { drawLayer, levels, View } from "./view.js";
import { words } from "./warnings.js";

const SHAPES = { sphere, teapot, knot };
const SAMPLES = ["sample.jpg", "samples/fox.jpg", "samples/helmet.jpg", "samples/hat.jpg"];
const PATIENT = 45; // ms that a whole frame may take before materials follow every third
const SOME = 3;
const LIGHT_EVERY = 600; // ms between two lights of a moving picture
const SUMMING = 9; // times as long as a sum of the tables takes, the next one waits on a moving picture
const OBJECT_EVERY = 400; // ms between two pictures of the object on a slow machine, if it is not turned

const $ = (id) => document.getElementById(id);
const view = new View($("frame"), $("overlay"));

let engine = null;
let config = null;
let loaded = null; // the promise of an engine
let source = null;
let frozen = false;
let fusion = true;
let number = 0;
let run = 0; // grows with each source: a loop ends when it is not its own any more
let cost = 0; // ms of a whole frame, averaged
const NOTHING = { source: null, material: null, fused: null, light: null, answer: null, told: null };
let last = { ...NOTHING }; // what is shown, and of which source
let pictures = 0; // grows with each picture that is estimated once: only the newest is shown
let tried = 0; // samples that the button has shown
let edits = {}; // what the sliders changed: diffuse, specular, logExponent
let lit = { kind: "studio", turn: 0, stops: 0, studio: studio() };

// ---------------------------------------------------------------- what is told

function say(text) {
  $("status").textContent = text;
}

function complain(text) {
  $("message").textContent = text;
  $("message").hidden = !text;
  $("stage").classList.toggle("stale", Boolean(text) && view.image !== null);
  if (!text) return;
  $("welcome").hidden = view.image !== null;
  $("speed").hidden = true;
}

let warned = "";

/** Show the reasons to distrust the estimate; the same ones again are not read out again. */
function warn(texts) {
  if (String(texts) === warned) return;
  warned = String(texts);
  $("warnings").replaceChildren(...texts.map((text) => element("li", text)));
  $("warnings").hidden = !texts.length;
}

const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// ---------------------------------------------------------------- the engine

/** Name what estimates: in the browser the processor may hand over to WebGPU between two frames. */
function tellAbout() {
  const told = `lime_keras ${config.version} · ${engine.about}`;
  if ($("about").textContent === told) return;
  $("about").textContent = told;
  $("about").title = config.system;
}

/** Whether an engine was found; one that is gone is waited for. */
async function findEngine() {
  for (;;) {
    try {
      // A worker that starts later, to be compared, tells nothing.
      ({ engine, config } = await loadEngine((text) => engine ?? say(text)));
      tellAbout();
      return true;
    } catch (error) {
      complain(error.message);
      say("Not ready");
      if (!(error instanceof EngineError)) console.error(error);
      if (error.kind !== "gone") return false;
      await wait(1000);
    }
  }
}

/**
 * Estimate one frame of the source that began as number `own`, and show the answer: "done",
 * "failed", or "again" if it was not the frame's fault. What comes after another source has begun,
 * or after the picture was frozen, is not shown.
 */
async function estimate(image, mask, wanted, own) {
  const begun = performance.now();
  const still = frozen;
  let answer;
  try {
    answer = await engine.estimate({ number: ++number, image, mask, options: wanted });
  } catch (error) {
    if (own !== run) return "again";
    if (error.kind === "busy") {
      await wait(50);
      return "again";
    }
    complain(error instanceof EngineError ? error.message : `This picture failed: ${error.message}`);
    if (!(error instanceof EngineError)) console.error(error);
    if (error.kind === "gone") {
      await wait(1000);
      // The server that comes back may have other weights.
      if (engine.name === "server" && (await findEngine())) say(source?.name ?? "Ready");
      engine.restart();
      return "again";
    }
    return "failed";
  }
  const round = performance.now() - begun;
  if (answer.number !== number || own !== run || still !== frozen) return "again";
  complain("");
  show(image, answer, round, wanted);
  return "done";
}

function show(image, answer, round, wanted) {
  const begun = performance.now();
  view.show(image, answer);
  $("welcome").hidden = true;
  tellAbout();
  if (last.source !== source) last = { ...NOTHING, source };
  if (answer.cut) last.light = null;
  const wasLost = last.answer && !last.answer.found;
  last.answer = answer;
  const seen = answer.material;
  if (seen) {
    last.material = seen;
    last.told = answer; // the frame of this material
    last.fused = answer.fused;
    if (wanted.layers) {
      drawLayer($("specular"), answer.layers.specular_shading, answer.size);
      drawLayer($("mirror"), answer.layers.mirror, answer.size);
    }
    if (answer.light) last.light = answer.light;
  }
  if (seen || !last.material) {
    showNumbers();
    relight(source.live && !frozen);
  }
  $("estimate").classList.toggle("stale", !answer.found);
  $("coverage").textContent = answer.found ? percent(answer.mask_coverage) : "no object";
  // A frame of the mask alone is judged by that alone.
  if (seen || !answer.found) {
    warn(answer.warnings.map(words));
  } else if (wasLost) {
    warn([]);
  }
  const drawing = performance.now() - begun;
  timing(answer.ms, round, drawing, wanted);
}

// ---------------------------------------------------------------- frames

let times = [];

async function follow(own) {
  let count = 0;
  let lightAt = -Infinity;
  let stuck = 0;
  while (own === run) {
    if (frozen || view.painted) {
      await wait(100);
      continue;
    }
    const image = await source.next();
    if (own !== run) return;
    if (source.gone) {
      complain("The camera is gone: plug it in and press Camera again, or drop a photo here.");
      $("freeze").disabled = true;
      $("speed").hidden = true;
      return;
    }
    if (!image) {
      stuck += 1;
      if (stuck === 3) complain("No picture arrives: is the camera covered, asleep or unplugged?");
      continue;
    }
    stuck = 0;
    if (frozen || view.painted) continue;
    const every = cost > PATIENT ? SOME : 1;
    const material = count % every === 0;
    const now = performance.now();
    const light = material && now - lightAt > LIGHT_EVERY;
    // Layers take a network of their own, and warnings the whole frame.
    const layers = count % SOME === 0 && $("specular").getClientRects().length > 0;
    if ((await estimate(image, null, { material, layers, light, fusion }, own)) === "done") {
      if (light) lightAt = now;
      count += 1;
      const done = performance.now();
      times = [...times.filter((time) => done - time < 4000), done];
    }
  }
}

/** Estimate the still picture, or the frozen frame, once. */
async function once(own = run) {
  const mask = view.painted ?? source.mask ?? null;
  const image = source.live ? view.image : source.frame();
  if (view.image !== image) view.preview(image);
  $("welcome").hidden = true;
  const count = ++pictures;
  let result = "again";
  while (own === run && count === pictures && source.live === frozen && result === "again") {
    result = await estimate(image, mask, { material: true, layers: true, light: true, fusion: false }, own);
  }
  // A picture that cannot be estimated leaves the one before it, without its source.
  if (own === run && result === "failed" && last.source !== source) {
    view.back();
    release();
    say("Ready");
  }
}

/** Part with the source: what it gave stays, and another can be chosen. */
function release() {
  source?.stop();
  source = null;
  frozen = false;
  stopPainting();
  press("freeze", false);
  $("freeze").disabled = $("brush").disabled = true;
  $("speed").hidden = true;
}

async function begin(open, told) {
  run += 1;
  const own = run;
  say(told);
  try {
    const opened = await open();
    if (own !== run) {
      opened.stop();
      return;
    }
    source?.stop();
    source = opened;
  } catch (error) {
    if (own !== run) return;
    complain(error.message);
    if (!(error instanceof EngineError)) console.error(error);
    say("Ready");
    if (source?.live) release();
    else if (source && last.source !== source) {
      // The photo that was being estimated is the one that stays.
      await once(own);
      if (own === run) complain(error.message);
    }
    return;
  }
  frozen = false;
  cost = 0;
  times = [];
  lightMs = undefined;
  stopPainting();
  press("freeze", false);
  $("freeze").disabled = !source.live;
  $("brush").disabled = false;
  complain("");
  say(source.name);
  engine.restart();
  if (source.deviceId) listCameras();
  if (source.live) {
    follow(own).catch((error) => {
      console.error(error);
      complain(`The page failed (${error.message}): load it again.`);
    });
  } else await once(own);
}

async function startCamera(deviceId) {
  await begin(() => {
    // Phones open one camera at a time.
    if (source?.deviceId) source.stop();
    return openCamera(deviceId);
  }, "Asking for the camera…");
}

async function listCameras() {
  const found = await cameras();
  $("cameras").hidden = found.length < 2;
  $("cameras").replaceChildren(
    ...found.map(({ deviceId, label }, index) => {
      const option = element("option", label || `Camera ${index + 1}`);
      option.value = deviceId;
      option.selected = deviceId === source?.deviceId;
      return option;
    }),
  );
}

function openFile(file, name) {
  const moving = file.type.startsWith("video/") || /\.(mp4|m4v|mov|webm|mkv|avi|ogv)$/i.test(name);
  return moving ? openVideo(file, name) : openPhoto(file, name, engine.decode?.bind(engine));
}

async function startFile(file) {
  if (!(await loaded)) return;
  const name = file.name || "the picture";
  await begin(() => openFile(file, name), `Opening ${name}…`);
}

async function startUrl(url, name) {
  await begin(async () => {
    const answer = await fetch(url).catch((error) => ({ status: error.message }));
    if (!answer.ok) throw new EngineError(`${name} cannot be loaded: ${answer.status}.`);
    const type = answer.headers.get("Content-Type") ?? "";
    return openFile(new File([await answer.blob()], name, { type }), name);
  }, `Opening ${name}…`);
}

// ---------------------------------------------------------------- numbers

const digits = (value) => value.toFixed(value < 0.0995 ? 3 : 2);
const percent = (share) => `${(100 * share).toFixed(share < 0.0995 ? 1 : 0)} %`;
const edge = (bin) => Number((10 ** (0.375 * bin)).toPrecision(2)); // the bin's lowest s
const gloss = (exponent) => exponent.toPrecision(exponent < 1000 ? 3 : 4).replace(/\.0+$/, "");

function element(tag, text) {
  const out = document.createElement(tag);
  if (text !== undefined) out.textContent = text;
  return out;
}

function press(id, on) {
  $(id).setAttribute("aria-pressed", String(on));
}

/** The estimate that is shown: fused over time if there is such, else this frame's. */
function estimated() {
  const found = { ...last.material, ...((fusion && last.fused) || {}) };
  const whole = found.diffuse_albedo && found.specular_albedo !== undefined && found.exponent !== undefined;
  return whole ? found : null;
}

/** The material of the virtual object: the estimate, and what the sliders changed. */
function current() {
  const found = estimated() ?? { diffuse_albedo: [0.35, 0.42, 0.2], specular_albedo: 0.3, exponent: 60 };
  return {
    diffuse_albedo: edits.diffuse ?? found.diffuse_albedo,
    specular_albedo: edits.specular ?? found.specular_albedo,
    exponent: edits.logExponent === undefined ? found.exponent : 10 ** edits.logExponent,
  };
}

/** The gloss of a material in words, and how likely it is glossy. */
function glossOf({ exponent, specular_albedo: specular }) {
  const likely = probability(config.gloss, exponent, specular);
  return { gloss: describe(likely, exponent, specular), glossy_probability: likely };
}

function showNumbers() {
  const found = estimated();
  for (const id of ["copy", "save-json", "save-gltf", "save-png"]) $(id).disabled = !found;
  $("swatch").style.background = found ? css(found.diffuse_albedo) : "";
  $("diffuse").textContent = found ? found.diffuse_albedo.map(digits).join("  ") : "–";
  $("specular-albedo").textContent = found ? digits(found.specular_albedo) : "–";
  const ends = interval(last.material?.exponent_bin_probabilities);
  $("gloss").textContent = found ? glossOf(found).gloss : "–";
  // Over time s is fused, and may lie outside the interval of the last frame.
  const holds = found && ends && ends[0] <= found.exponent && found.exponent <= ends[1];
  $("exponent").textContent = found ? inNumbers(found.exponent, holds ? ends : null) : "–";
  showBins(last.material?.exponent_bin_probabilities ?? []);
  if (!found) for (const id of ["specular", "mirror"]) $(id).width = 128; // which empties it
  showSliders();
}

function showBins(probabilities) {
  const full = Math.max(0.4, ...probabilities);
  $("bins").replaceChildren(
    ...Array.from({ length: 8 }, (_, at) => {
      const share = probabilities[at] ?? 0;
      const [bin, bar] = [element("span"), element("b")];
      bar.style.height = `${(100 * share) / full}%`;
      bin.title = percent(share);
      bin.append(bar);
      return bin;
    }),
  );
  const told = probabilities.map((share, at) => `from ${edge(at)} ${percent(share)}`);
  $("bins").setAttribute("aria-label", `Probabilities of the shininess classes: ${told.join(", ") || "none yet"}`);
}

function showSliders() {
  const { diffuse_albedo: diffuse, specular_albedo: specular, exponent } = current();
  const values = {
    red: [diffuse[0], digits(diffuse[0])],
    green: [diffuse[1], digits(diffuse[1])],
    blue: [diffuse[2], digits(diffuse[2])],
    ms: [specular, digits(specular)],
    logs: [Math.log10(exponent), gloss(exponent)],
    turn: [lit.turn, `${lit.turn}°`],
    stops: [lit.stops, `${lit.stops > 0 ? "+" : ""}${lit.stops.toFixed(1)} EV`],
  };
  for (const [id, [value, text]] of Object.entries(values)) {
    if (document.activeElement !== $(id) || !$(id).matches(":active")) $(id).value = value;
    $(id).nextElementSibling.textContent = text;
    $(id).setAttribute("aria-valuetext", text);
  }
  const changed = Object.keys(edits).length > 0;
  $("edited").hidden = !changed;
  $("reset").disabled = !(changed || lit.turn || lit.stops || lit.kind !== "studio");
}

function numbersText() {
  const { source: seen, material, fused, told } = last;
  const { square, mask_coverage } = told;
  const { exponent, exponent_bin_probabilities: probabilities } = material;
  const ends = interval(probabilities);
  const derived = {
    exponent_interval: ends,
    ...glossOf(material),
    roughness: gltfMaterial(material).pbrMetallicRoughness.roughnessFactor,
    diffuse_srgb_hex: hex(material.diffuse_albedo),
  };
  const whole = { ...material, ...derived, mask_coverage, square };
  if (fused && fusion) whole.fused = fused;
  if (Object.keys(edits).length) whole.edited = current();
  return JSON.stringify({ picture: seen.name, ...whole }, null, 1) + "\n";
}

let lightMs; // ms of the source's last light, which few frames have

function timing(ms, round, drawing, wanted) {
  // A frame with the material tells what each would cost; the light comes now and then.
  if (wanted.material) cost += (cost ? 0.2 : 1) * (round + drawing - (ms.light ?? 0) - cost);
  lightMs = ms.light ?? lightMs;
  const parts = {
    mask: ms.framing_and_mask,
    material: ms.material,
    light: lightMs,
    transfer: Math.max(round - ms.total, 0),
    drawing,
  };
  const told = Object.entries(parts).filter(([, value]) => value !== undefined);
  // The parts of a frame without materials would make the line flicker.
  if (wanted.material) {
    $("timing").textContent = `${(round + drawing).toFixed(0)} ms a picture`;
    $("timing").title = told.map(([name, value]) => `${name} ${value.toFixed(0)} ms`).join(", ");
  }
  const live = source.live && !frozen && times.length > 1;
  $("speed").hidden = !live;
  if (live) {
    const rate = (1000 * (times.length - 1)) / (times.at(-1) - times[0]);
    const some = cost > PATIENT ? ` · material every ${SOME}rd` : "";
    $("speed").textContent = `${rate.toFixed(rate < 10 ? 1 : 0)} frames/s${some}`;
  }
}

// ---------------------------------------------------------------- the object

let renderer = null;
const worker = new Worker(new URL("./shading_worker.js", import.meta.url), { type: "module" });
let asked = null; // what the worker sums now
let waiting = null; // what it is to sum next; only the newest counts
let restUntil = 0; // when it may sum what is not urgent
let rest = 0;
let lightKey = 0;

function light() {
  const found = lit.kind === "found" && last.light ? last.light : lit.studio;
  return turned(found, (lit.turn * Math.PI) / 180, 2 ** lit.stops);
}

/**
 * Sum the tables anew, because light or gloss changed; the colours alone take no sum. `calm` leaves
 * the processor to the networks: what an answer changed may be seen a little later.
 */
function relight(calm = false) {
  colour(calm);
  $("no-light").hidden = lit.kind === "studio" || last.light !== null;
  const now = light();
  const panorama = $("panorama");
  levels(panorama).putImageData(new ImageData(picture(now), now.width, now.height), 0, 0);
  const key = `${lit.kind} ${lit.turn} ${lit.stops} ${lightNumber()}`;
  const before = (estimated() ?? current()).exponent;
  const exponents = before === current().exponent ? [before] : [before, current().exponent];
  const wanted = { key, light: now, exponents, size: TABLE };
  // What is summed now, or was last, is no longer to be followed by what was wanted in between.
  const same = asked && asked.key === key && String(asked.exponents) === String(exponents);
  waiting = same ? null : wanted;
  if (!calm) restUntil = 0;
  sendNext();
}

/** Send what waits to the worker, if it is free and has rested. */
function sendNext() {
  clearTimeout(rest);
  document.body.toggleAttribute("data-lit", !waiting && !asked?.busy);
  if (!waiting || asked?.busy) return;
  const left = restUntil - performance.now();
  if (left > 0) rest = setTimeout(sendNext, left);
  else {
    asked = { ...waiting, busy: true };
    waiting = null;
    worker.postMessage(asked);
  }
}

const numbered = new WeakMap();
function lightNumber() {
  if (!last.light) return 0;
  if (!numbered.has(last.light)) numbered.set(last.light, ++lightKey);
  return numbered.get(last.light);
}

worker.onmessage = ({ data }) => {
  asked.busy = false;
  renderer?.light(data.texels);
  redraw(source?.live && !frozen);
  restUntil = performance.now() + SUMMING * data.ms;
  sendNext();
};

function colour(calm = false) {
  const [before, now] = [estimated() ?? current(), current()];
  if (!renderer) return;
  renderer.materials = [before, now].map(({ diffuse_albedo, specular_albedo }) => [
    ...diffuse_albedo,
    specular_albedo,
  ]);
  redraw(calm);
}

let drawn = 0;
let drawnAt = -Infinity;
let later = 0;
function redraw(calm = false) {
  const left = calm === true && cost > PATIENT ? drawnAt + OBJECT_EVERY - performance.now() : 0;
  clearTimeout(later);
  if (left > 0) {
    later = setTimeout(redraw, left);
    return;
  }
  cancelAnimationFrame(drawn);
  drawn = requestAnimationFrame(() => {
    drawnAt = performance.now();
    renderer?.draw();
    if (renderer && isPressed("clone")) view.beside(renderer.canvas);
  });
}

function choose(group, chosen) {
  for (const button of group.querySelectorAll('[role="radio"]')) {
    const on = button === chosen;
    button.setAttribute("aria-checked", String(on));
    button.tabIndex = on ? 0 : -1;
  }
}

function shape(name, mesh) {
  if (!renderer) return;
  renderer.show(mesh ?? SHAPES[name]());
  const button = document.querySelector(`[data-shape="${name}"]`);
  choose(button.parentElement, button);
  redraw();
}

async function ownMesh(file) {
  try {
    shape("own", parse(await file.arrayBuffer(), file.name));
    $("object-message").hidden = true;
  } catch (error) {
    $("object-message").textContent = error.message;
    $("object-message").hidden = false;
  }
}

function startObject() {
  const canvas = $("object");
  try {
    renderer = new Renderer(canvas);
  } catch (error) {
    $("object-message").textContent = error.message;
    $("object-message").hidden = false;
    return;
  }
  shape("teapot");
  new ResizeObserver(redraw).observe(canvas);
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!canvas.hasPointerCapture(event.pointerId)) return;
    renderer.rotate(event.movementX / 120, event.movementY / 120);
    redraw();
  });
  canvas.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    renderer.rotate(0.12 * step[0], 0.12 * step[1]);
    redraw();
  });
}

// ---------------------------------------------------------------- the brush

let erasing = false;

function startPainting() {
  if (!view.image) return;
  if (source.live) freeze(true);
  complain("");
  view.beginPainting();
  $("stage").classList.add("painting");
  $("brush-tools").hidden = false;
  press("brush", true);
  say("Paint the object; hold Shift to take away");
}

function stopPainting() {
  view.painted = null;
  erasing = false;
  $("stage").classList.remove("painting");
  $("brush-tools").hidden = true;
  press("brush", false);
  press("erase", false);
  if (view.image) view.outline();
}

function brushing() {
  const overlay = $("overlay");
  let from = null;
  const place = (event) => {
    // The frame is fitted into the canvas, which may be wider or taller.
    const box = overlay.getBoundingClientRect();
    const scale = Math.min(box.width / overlay.width, box.height / overlay.height);
    const x = (event.clientX - box.left - (box.width - scale * overlay.width) / 2) / scale;
    const y = (event.clientY - box.top - (box.height - scale * overlay.height) / 2) / scale;
    return [x / overlay.width, y / overlay.height];
  };
  const stroke = (event) => {
    const to = place(event);
    const value = erasing !== event.shiftKey ? 0 : 255;
    view.paint(from ?? to, to, $("brush-size").value / 200, value);
    from = to;
  };
  overlay.addEventListener("pointerdown", (event) => {
    if (!view.painted) return;
    overlay.setPointerCapture(event.pointerId);
    from = null;
    stroke(event);
  });
  overlay.addEventListener("pointermove", (event) => {
    if (view.painted && from && overlay.hasPointerCapture(event.pointerId)) stroke(event);
  });
  overlay.addEventListener("pointerup", () => {
    if (view.painted && from) once();
    from = null;
  });
  overlay.addEventListener("pointercancel", () => (from = null));
}

// ---------------------------------------------------------------- controls

function freeze(on) {
  if (!source?.live) return;
  frozen = on;
  press("freeze", on);
  $("speed").hidden = on;
  say(on ? "Frozen" : source.name);
  if (!on) stopPainting();
}

function reset() {
  edits = {};
  lit = { ...lit, kind: "studio", turn: 0, stops: 0 };
  const first = document.querySelector('[data-light="studio"]');
  choose(first.parentElement, first);
  showSliders();
  relight();
}

function splitObject(on) {
  press("before", on);
  $("before-label").hidden = $("after-label").hidden = !on;
  if (renderer) renderer.split = on ? 0.5 : 0;
  redraw();
}

/** Show the virtual object in the picture, too, or take it away from there. */
function cloneObject(on) {
  press("clone", on);
  if (!on) view.beside(null);
  redraw();
}

const isPressed = (id) => $(id).getAttribute("aria-pressed") === "true";

function wire() {
  const file = $("file");
  $("camera").onclick = () => startCamera();
  navigator.mediaDevices?.addEventListener?.("devicechange", () => source?.deviceId && listCameras());
  $("cameras").onchange = () => startCamera($("cameras").value);
  file.onchange = () => file.files[0] && startFile(file.files[0]).finally(() => (file.value = ""));
  $("sample").onclick = () => {
    const path = SAMPLES[tried++ % SAMPLES.length];
    startUrl(path, path.split("/").at(-1));
  };
  for (const button of document.querySelectorAll("[data-sample]")) {
    button.onclick = () => startUrl(button.dataset.sample, button.dataset.sample.split("/").at(-1));
  }
  $("freeze").onclick = () => freeze(!frozen);
  $("outline").onclick = () => {
    view.outlined = !view.outlined;
    press("outline", view.outlined);
    if (view.image) view.outline();
  };
  $("fusion").onclick = () => {
    fusion = !fusion;
    press("fusion", fusion);
    engine.restart();
    last.fused = null;
    showNumbers();
  };
  $("brush").onclick = () => {
    if (!view.painted) startPainting();
    else {
      stopPainting();
      if (source.live) freeze(false);
    }
  };
  $("brush-reset").onclick = () => {
    stopPainting();
    if (source) source.mask = null;
    const own = run;
    once().then(() => own === run && startPainting());
  };
  $("erase").onclick = () => {
    erasing = !erasing;
    press("erase", erasing);
  };
  for (const button of document.querySelectorAll("[data-shape]")) {
    button.onclick = () => (button.dataset.shape === "own" ? $("mesh").click() : shape(button.dataset.shape));
  }
  $("mesh").onchange = () => {
    const [given] = $("mesh").files;
    if (given) ownMesh(given).finally(() => ($("mesh").value = ""));
  };
  for (const button of document.querySelectorAll("[data-light]")) {
    button.onclick = () => {
      lit.kind = button.dataset.light;
      choose(button.parentElement, button);
      showSliders();
      relight();
    };
  }
  for (const group of document.querySelectorAll('[role="radiogroup"]')) {
    group.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      const all = [...group.querySelectorAll('[role="radio"]')];
      const next = all[(all.indexOf(document.activeElement) + step + all.length) % all.length];
      next.focus();
      if (next.dataset.shape !== "own") next.click();
    });
  }
  const colours = ["red", "green", "blue"];
  for (const id of [...colours, "ms", "logs"]) {
    $(id).oninput = () => {
      const value = Number($(id).value);
      if (id === "ms") edits.specular = value;
      else if (id === "logs") edits.logExponent = value;
      else {
        edits.diffuse = [...current().diffuse_albedo];
        edits.diffuse[colours.indexOf(id)] = value;
      }
      showSliders();
      if (id === "logs") relight();
      else colour();
    };
  }
  for (const id of ["turn", "stops"]) {
    $(id).oninput = () => {
      lit[id] = Number($(id).value);
      showSliders();
      relight();
    };
  }
  $("reset").onclick = reset;
  $("before").onclick = () => splitObject(!isPressed("before"));
  $("clone").onclick = () => cloneObject(!isPressed("clone"));
  $("copy").onclick = async () => {
    try {
      await navigator.clipboard.writeText(numbersText());
      say("The numbers are on the clipboard");
    } catch {
      say("The browser did not allow the clipboard: take JSON instead");
    }
  };
  $("save-json").onclick = () =>
    download(new Blob([numbersText()], { type: "application/json" }), "material.json");
  $("save-gltf").onclick = () =>
    download(new Blob([gltf(current(), config.version)], { type: "model/gltf+json" }), "material.gltf");
  $("save-png").onclick = async () => renderer && download(await renderer.picture(), "material.png");
  brushing();
  keys();
}

function dropping() {
  let depth = 0;
  const shows = (on) => ($("drop").hidden = !on);
  addEventListener("dragenter", (event) => {
    event.preventDefault();
    depth += 1;
    shows(true);
  });
  addEventListener("dragleave", () => shows((depth -= 1) > 0));
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    depth = 0;
    shows(false);
    const [given] = event.dataTransfer.files;
    if (!given) complain("Drop a file: a photo, a video, or a GLB or PLY mesh.");
    else if (/\.(glb|ply)$/i.test(given.name)) ownMesh(given);
    else startFile(given);
  });
  addEventListener("paste", (event) => {
    const given = [...(event.clipboardData?.files ?? [])][0];
    if (given) startFile(given);
  });
}

function keys() {
  const actions = {
    " ": "freeze", c: "camera", m: "outline", p: "brush", f: "fusion", b: "before", i: "clone",
    r: "reset",
  };
  const shapes = ["sphere", "teapot", "knot"];
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest("input, select, textarea")) return;
    if (event.key === " " && event.target.closest("button")) return;
    const id = actions[event.key.toLowerCase()];
    if (id) {
      event.preventDefault();
      if (!$(id).disabled) $(id).click();
    } else if (shapes[Number(event.key) - 1]) shape(shapes[Number(event.key) - 1]);
  });
}

async function main() {
  startObject();
  $("edges").replaceChildren(...Array.from({ length: 9 }, (_, bin) => element("span", edge(bin))));
  showNumbers();
  relight();
  for (const group of document.querySelectorAll('[role="radiogroup"]')) {
    choose(group, group.querySelector('[aria-checked="true"]'));
  }
  loaded = findEngine();
  // A file that is dropped too early waits, where the browser would leave the page for it.
  dropping();
  if (!(await loaded)) return;
  complain("");
  wire();
  say("Ready");
  $("sources").inert = false;
  document.body.dataset.ready = "yes";
  const { start } = config;
  if (start?.kind === "camera") await startCamera();
  else if (start) await startUrl("source", start.name);
}

main();
