// The page: shows the server's messages and sends user input; the server acts on the newest one.

import { Catalog } from "./catalog.js";
import { Controls } from "./controls.js";
import { byId, download, listenToHeader, make, short, toast } from "./dom.js";
import { Drive, isTyping } from "./drive.js";
import { FloorMap } from "./map.js";
import { markPreset, showPresets } from "./presets.js";
import { drawProfile } from "./profile.js";
import { Stream } from "./stream.js";
import { View, arrange, titleOf } from "./views.js";

const FIRST = ["panorama", "map", "range"]; // views on a first visit
const SMALL_FIRST = []; // the same on a phone
const SHORTCUTS = ["panorama", "perspective", "birdseye", "map", "range"];
const TURN_DEG = 180; // turn by a drag across an image
const views = new Map();
const state = { about: {}, camera: {}, frame: {}, drives: false, map: null, mapMessage: null, names: [], isProbing: false, pointed: null, probedChange: -1, probedPoints: "", playing: 0, counted: {} };
const rates = [];

const stream = new Stream("stream", {
  open: () => send("ask"),
  closed: () => {
    byId("title").textContent = "connection lost; reconnecting …";
    state.drives = false;
  },
  hello: showAbout,
  roles: showRoles,
  camera: showCamera,
  frame: showFrame,
  map: (message) => {
    state.mapMessage = message;
    state.map?.setImage(message.parts[0].blob, message);
  },
  probe: showProbe,
  statistics: (counted) => {
    state.counted = counted;
    showTimes();
  },
  found: (message) => catalog.show(message),
  saved: (message) => download(message.name, message.parts[0].blob),
  error: showFault,
});
const send = (type, content) => stream.send({ type, ...content });
const controls = new Controls((path, value) => send("set", { path, value }));
const catalog = new Catalog(
  (words) => send("search", { words }),
  ({ name, title }) => {
    send("preset", { kind: "catalog", name });
    toast(title);
  },
);
new Drive((type, command) => state.drives && send(type, command));
listen();

function showAbout(about) {
  state.about = about;
  const who = about.robot ?? "free flight";
  byId("title").textContent = about.steps === null ? `${about.scene} · ${who}` : who;
  document.title = `${about.scene} – omnisim live`;
  byId("side").hidden = !about.is_editable;
  byId("clock").hidden = !about.has_clock;
  byId("walls").hidden = !about.has_walls;
  byId("start").hidden = about.steps !== null;
  byId("pad").hidden = about.steps !== null;
  document.querySelector("main").style.gridTemplateColumns = about.is_editable ? "" : "minmax(0, 1fr)";
  if (about.is_editable) showPresets(about.presets, (kind, name) => send("preset", { kind, name }));
  if (about.steps !== null) {
    byId("replay").hidden = false;
    byId("step").max = about.steps - 1;
  }
  if (!state.names.length) {
    const saved = (localStorage.getItem("omnisim-views") ?? "").split(",").filter(Boolean);
    const first = innerWidth <= 760 ? SMALL_FIRST : FIRST;
    state.names = (localStorage.getItem("omnisim-views") === null ? first : saved).filter(isKnown);
  }
  showViews();
}

function isKnown(name) {
  return name in state.about.channels || state.about.views.includes(name);
}

function showRoles({ drives, pages }) {
  const isNew = drives && !state.drives;
  state.drives = drives;
  byId("roles").textContent = drives ? (pages > 1 ? `you drive, ${pages - 1} watching` : "") : "watching";
  byId("wheel").hidden = drives;
  if (isNew) sendViews();
}

function showCamera(camera) {
  state.camera = camera;
  controls.show(camera.groups);
  byId("profile-box").hidden = false;
  byId("profile-title").textContent = camera.profile.kind === "section" ? "Profile and rays" : "Radius by angle";
  drawProfile(byId("profile"), camera.profile);
  markPreset(camera.model);
  byId("fault").hidden = true;
}

async function showFrame(frame) {
  state.frame = frame;
  const shown = frame.parts.map((part) => views.get(part.name)?.show(part, frame.is_fine));
  if (state.about.steps !== null) state.map?.clearTrail(); // the recorded path is drawn instead
  state.map?.update({ place: frame.viewpoint, ...(frame.seen_m ? { seen_m: frame.seen_m } : {}) });
  await Promise.allSettled(shown);
  fit();
  send("ask");
  countRate();
  showPlace(frame);
  const camera = views.get("camera");
  camera.detail = `${state.camera.model ?? ""} ${camera.canvas.width} × ${camera.canvas.height} px`;
  byId("walls").setAttribute("aria-pressed", String(frame.walls));
  byId("undo").disabled = !frame.history[0];
  byId("redo").disabled = !frame.history[1];
  byId("step").value = frame.step;
  byId("step-label").textContent = `${frame.step + 1} of ${state.about.steps ?? ""}`;
  if (!byId("times").hidden) showTimes();
  document.body.dataset.change = frame.change;
  document.body.dataset.fine = frame.is_fine;
  if (frame.is_fine && state.playing) advance();
  if (pointsOf(frame) !== state.probedPoints) hideMarks();
  if (frame.is_fine && state.pointed && frame.change !== state.probedChange) probe(...state.pointed);
}

function showPlace({ viewpoint, blocked_by: blocked }) {
  const [x, y, z] = viewpoint.position_m.map((value) => value.toFixed(2));
  const tilt = Math.abs(viewpoint.pitch_deg) > 0.05 ? `, pitch ${viewpoint.pitch_deg.toFixed(1)}°` : "";
  const wall = blocked ? ` · blocked by ${blocked}` : "";
  byId("place").textContent = `x ${x}  y ${y}  z ${z} m, yaw ${viewpoint.yaw_deg.toFixed(1)}°${tilt}${wall}`;
}

function countRate() {
  const now = performance.now();
  rates.push(now);
  while (rates.length && rates[0] < now - 2000) rates.shift();
  byId("rate").textContent = rates.length > 2 ? `${((1000 * (rates.length - 1)) / (now - rates[0])).toFixed(0)} /s` : "at rest";
}
setInterval(() => {
  while (rates.length && rates[0] < performance.now() - 2000) rates.shift();
  if (rates.length <= 2) byId("rate").textContent = "at rest";
}, 1000);

function showTimes() {
  const rows = Object.entries(state.frame.times_ms ?? {}).filter(([, ms]) => ms >= 0.05);
  const total = rows.reduce((sum, [, ms]) => sum + ms, 0);
  const row = (name, text) => make("div", {}, make("span", { text: name }), make("span", { text }));
  const line = (name, ms) => row(name, `${ms.toFixed(1)} ms`);
  const count = make("button", { text: "Count triangles", onclick: () => send("statistics") });
  const isCounted = state.counted.change === state.frame.change;
  const triangles = ["submitted", "drawn", "seen"].map((name) => row(`triangles ${name}`, state.counted[name]?.toLocaleString("en")));
  const below = isCounted ? triangles : [count];
  byId("times").replaceChildren(...rows.map(([name, ms]) => line(name, ms)), make("hr"), line("total", total), ...(state.about.is_editable ? [make("hr"), ...below] : []));
}

function showProbe(answer) {
  state.isProbing = false;
  for (const [name, view] of views) {
    const place = answer.marks[name] ?? (name !== "camera" && name in state.about.channels ? answer.marks.camera : null);
    if (name !== "map") view.mark(place ?? null);
  }
  state.map?.update({ point: answer.point_m ?? null });
  if (answer.reason) return void (byId("probe").textContent = answer.reason);
  if (!("yaw_deg" in answer)) return;
  const parts = [`direction ${answer.yaw_deg.toFixed(1)}°, ${(-answer.pitch_deg).toFixed(1)}° up`];
  if (answer.pixel) parts.unshift(`pixel ${answer.pixel.join(", ")}`);
  if (answer.range_m !== undefined) parts.push(answer.range_m === null ? "nothing hit" : `${short(answer.range_m, 4)} m`);
  if (answer.class) parts.push(answer.class);
  if (answer.instance && answer.instance !== answer.class) parts.push(answer.instance);
  if (answer.point_m) parts.push(`(${answer.point_m.map((value) => value.toFixed(3)).join(", ")}) m`);
  byId("probe").textContent = parts.join(" · ");
}

function showFault({ text }) {
  const message = text.replace(/^(camera|optics)\.toml: /gm, "");
  if (!state.about.is_editable) return toast(message);
  byId("fault").textContent = message;
  byId("fault").hidden = false;
  controls.restore();
  toast(message);
}

// Views

function showViews() {
  const names = ["camera", ...state.names];
  for (const [name, view] of views) {
    if (names.includes(name)) continue;
    view.element.remove();
    views.delete(name);
    if (name === "map") state.map = null;
  }
  for (const name of names) {
    if (!views.has(name)) addView(name);
    const { element } = views.get(name);
    if (name === "camera") byId("views").prepend(element);
    else byId("others").append(element);
  }
  byId("views").className = names.length === 1 ? "single" : names.length > 3 ? "crowd" : "";
  fit();
  showChips();
  sendViews();
}

let arranged = "";

function fit() {
  const shapes = [...views].map(([name, { canvas }]) => `${name} ${(canvas.width / canvas.height).toFixed(2)}`);
  const key = [innerWidth, innerHeight, ...shapes].join();
  if (key !== arranged) arrange(views, byId("stage"));
  arranged = key;
}

function sendViews() {
  if (state.drives && state.about.views) send("views", { names: state.names });
}

function addView(name) {
  const view = new View(name, name === "map" ? mapHooks : imageHooks);
  views.set(name, view);
  if (name !== "map") return;
  state.map = new FloorMap(view);
  view.reason = state.mapMessage ? "" : "building the map …";
  state.map.update({ outline_m: state.about.outline_m, driven_m: state.about.driven_m });
  if (state.mapMessage) state.map.setImage(state.mapMessage.parts[0].blob, state.mapMessage);
  if (state.frame.viewpoint) state.map.update({ place: state.frame.viewpoint, seen_m: state.frame.seen_m });
}

function showChips() {
  const first = SHORTCUTS.filter(isKnown);
  const chip = (name) => make("button", { "aria-pressed": String(state.names.includes(name)), "data-view": name, text: titleOf(name), onclick: () => toggle(name) });
  const others = Object.keys(state.about.channels).filter((name) => !first.includes(name));
  const shown = others.filter((name) => state.names.includes(name) || ["semantic", "instance", "normals"].includes(name));
  const rest = others.filter((name) => !shown.includes(name));
  const more = make("select", { "aria-label": "More channels" }, make("option", { value: "", text: "more …" }), ...rest.map((name) => make("option", { value: name, text: titleOf(name), title: state.about.channels[name] })));
  more.addEventListener("change", () => toggle(more.value));
  byId("chips").replaceChildren(...first.map(chip), ...shown.map(chip), ...(rest.length ? [more] : []));
}

function toggle(name) {
  if (!isKnown(name)) return;
  state.names = state.names.includes(name) ? state.names.filter((one) => one !== name) : [...state.names, name];
  localStorage.setItem("omnisim-views", state.names.join(","));
  showViews();
}

/** Key of an image's content: viewpoint, time, step and camera, without the views beside it. */
function pointsOf({ viewpoint, time_s: time, step }) {
  return JSON.stringify([viewpoint, time, step, state.camera.text]);
}

function hideMarks() {
  for (const view of views.values()) view.mark(null);
  state.map?.update({ point: null });
}

function probe(view, u, v) {
  state.pointed = [view, u, v];
  if (state.isProbing) return;
  state.isProbing = true;
  state.probedChange = state.frame.change;
  state.probedPoints = pointsOf(state.frame);
  setTimeout(() => (state.isProbing = false), 400); // during motion an answer may not come
  send("probe", { view: view.name in state.about.channels ? "camera" : view.name, u, v, follow: views.has("perspective") && state.drives });
}

const imageHooks = {
  probe,
  click: probe, // for touch, which cannot hover
  close: toggle,
  leave: () => {
    state.pointed = null;
    hideMarks();
  },
  drag: (view, du, dv) => {
    if (!state.drives || state.about.steps !== null) return;
    const look = state.frame.look;
    if (view.name === "perspective") {
      const turned = { ...look, yaw_deg: wrap(look.yaw_deg + du * look.fov_deg), pitch_deg: clamp(look.pitch_deg - dv * look.fov_deg, -89, 89) };
      state.frame.look = turned;
      send("look", turned);
    } else send("turn", { yaw_deg: du * TURN_DEG, pitch_deg: view.name === "camera" ? 0 : -dv * 45 });
  },
  wheel: (view, delta) => {
    if (view.name !== "perspective" || !state.drives) return;
    const look = { ...state.frame.look, fov_deg: clamp(state.frame.look.fov_deg * 1.0015 ** delta, 10, 140) };
    state.frame.look = look;
    send("look", look);
  },
};

const mapHooks = {
  close: toggle,
  wheel: (view, delta, u, v) => state.map.zoom(1.0015 ** -delta, u, v),
  drag: (view, du, dv) => state.map.pan(du, dv),
  click: (view, u, v) => {
    if (!state.drives || state.about.steps !== null) return;
    const [x, y] = state.map.world(u, v);
    send("go", { x, y });
  },
};

function wrap(angle) {
  return ((((angle + 180) % 360) + 360) % 360) - 180;
}

function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}

// Replay

function advance() {
  const next = state.frame.step + 1;
  if (next >= state.about.steps) return setPlaying(false);
  clearTimeout(state.playing);
  state.playing = setTimeout(() => send("replay", { step: next }), 60);
}

function setPlaying(isOn) {
  clearTimeout(state.playing);
  state.playing = isOn ? 1 : 0;
  byId("play").textContent = isOn ? "❚❚" : "▶";
  byId("play").setAttribute("aria-label", isOn ? "Pause" : "Play");
  if (!isOn) return;
  if (state.frame.step + 1 >= state.about.steps) send("replay", { step: 0 });
  else advance();
}

// Buttons and keys

function listen() {
  listenToHeader();
  byId("wheel").onclick = () => send("wheel");
  for (const name of ["undo", "redo", "reset"]) byId(name).onclick = () => send(name);
  byId("save-toml").onclick = () => send("save", { what: "toml" });
  byId("save-image").onclick = () => {
    toast("Rendering all channels …");
    send("save", { what: "image" });
  };
  byId("copy-command").onclick = copyCommand;
  byId("rate").onclick = () => {
    const box = byId("times");
    box.hidden = !box.hidden;
    byId("rate").setAttribute("aria-expanded", String(!box.hidden));
    showTimes();
  };
  byId("step").oninput = () => {
    setPlaying(false);
    send("replay", { step: Number(byId("step").value) });
  };
  byId("clock").onclick = () => {
    const running = byId("clock").getAttribute("aria-pressed") === "false";
    byId("clock").setAttribute("aria-pressed", String(running));
    send("clock", { running });
  };
  addEventListener("resize", fit);
  byId("start").onclick = () => send("start");
  byId("walls").onclick = toggleWalls;
  byId("play").onclick = () => setPlaying(!state.playing);
  addEventListener("keydown", (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z" && !event.target.matches("input[type=text], input[type=number], input[type=search]")) {
      event.preventDefault();
      send(event.shiftKey ? "redo" : "undo");
    } else if (isTyping(event)) return;
    else if (event.key === "?") byId("help-dialog").showModal();
    else if (event.key.toLowerCase() === "h") byId("start").click();
    else if (event.key.toLowerCase() === "c") byId("walls").click();
    else if (SHORTCUTS[Number(event.key) - 1]) toggle(SHORTCUTS[Number(event.key) - 1]);
  });
}

function toggleWalls() {
  const on = !state.frame.walls;
  send("walls", { on });
  toast(on ? "Walls stop free flight." : "Free flight passes through walls.");
}

async function copyCommand() {
  const text = state.frame.command;
  if (!text) return toast("Wait until the camera is at rest.");
  try {
    await navigator.clipboard.writeText(text);
    toast("Copied: paste it into a terminal.");
  } catch {
    const area = make("textarea", { value: text });
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
    toast("Copied: paste it into a terminal.");
  }
}

// State of the page, for its tests.
globalThis.omnisim = { state, views, send };
