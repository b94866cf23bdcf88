// Page of served robots: shows what one measures, drives it, and lists the clients of all protocols.

import { byId, listenToHeader, make, toast } from "./dom.js";
import { Drive, isTyping } from "./drive.js";
import { FloorMap } from "./map.js";
import { hitsOf, imageOf, mapOf, onMap, outlineOf, placeAt, placeOf } from "./messages.js";
import { Stream } from "./stream.js";
import { View, arrange } from "./views.js";

const IMAGES = ["sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"];
const HITS = ["sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"];
const POLL_MS = 500; // between questions for the state
const STEP_S = 0.1;
const RATE_MS = 4000; // over which rates are counted
const KEPT = 100; // places, to draw scans where they were measured
const FIRST_IMAGES = 4; // that are shown on a first visit
const LEAST_PX = 200; // width of a view beside the first
const MAP = "/map";
const TRUTH = "/ground_truth/odom";
// Speeds of keys and sticks; the robot's own limits clamp them.
const LIMITS = { speed_mps: { label: "keys drive at", unit: "m/s", value: 0.5, most: 3 }, turn_rate_radps: { label: "keys turn at", unit: "rad/s", value: 0.8, most: 3 } };

const views = new Map(); // by topic
const state = { hello: null, robot: "", isPaused: false, nowS: 0, polled: [], shown: {}, main: "", images: {}, hits: {}, frames: {}, others: {}, places: [], map: null, mapImage: null, outline: undefined, clients: [] };

const stream = new Stream("", {
  closed: () => (byId("title").textContent = "connection lost; reconnecting …"),
  hello: showRobots,
  message: take,
  state: showState,
  error: ({ text }) => toast(text),
});
const send = (op, content = {}) => stream.send({ op, ...content });
new Drive((_, { ahead, left, turn, fast }) => {
  const rate = Math.min(1, Math.max(-1, left + turn));
  send("command", { robot: state.robot, speed_mps: ahead * fast * LIMITS.speed_mps.value, turn_rate_radps: rate * fast * LIMITS.turn_rate_radps.value });
});
listen();

// Robots and their streams

function showRobots(hello) {
  state.hello = hello;
  const { robots } = hello;
  if (!robots.includes(state.robot)) state.robot = robots[0];
  byId("robot").hidden = robots.length < 2;
  byId("title").hidden = robots.length > 1;
  byId("robot").replaceChildren(...robots.map((name) => make("option", { value: name, text: name })));
  byId("title").textContent = state.robot;
  chooseRobot(state.robot);
  send("state");
}

function chooseRobot(name) {
  state.robot = byId("robot").value = name;
  document.title = `${name} – omnisim serve`;
  const images = imageTopics();
  const colors = images.filter((topic) => topic.includes("/image_raw"));
  const first = [...colors.slice(0, FIRST_IMAGES), ...topicsOf(HITS), MAP];
  const saved = JSON.parse(localStorage.getItem("omnisim-streams") ?? "{}");
  state.shown = Object.fromEntries([...images, ...topicsOf(HITS), MAP].map((topic) => [topic, saved[topic] ?? first.includes(topic)]));
  Object.assign(state, { main: colors[0] ?? images[0], images: {}, hits: {}, others: {}, outline: undefined });
  forgetMotion();
  showViews();
}

const prefix = () => (state.hello.robots.length > 1 ? `/${state.robot}` : "");
const topicsOf = (types) => state.hello.topics.filter(({ name, type }) => types.includes(type) && name.startsWith(`${prefix()}/`)).map(({ name }) => name);
const titleOf = (topic) => (topic === MAP ? "Map" : topic.slice(prefix().length + 1).replace(/\/(image_raw(\/compressed)?|depth\/image_rect|scan|points)$/, ""));

/** Topics of images; those of pixels only where there are none that are compressed. */
function imageTopics() {
  const topics = topicsOf(IMAGES);
  return topics.filter((topic) => !topics.includes(`${topic}/compressed`));
}

function subscribe() {
  const truths = state.hello.topics.map(({ name }) => name).filter((name) => name.endsWith(TRUTH));
  const always = [MAP, "/tf_static", `${prefix()}/robot_description`, ...truths];
  const shown = Object.keys(state.shown).filter((topic) => state.shown[topic] && (views.has(MAP) || !topicsOf(HITS).includes(topic)));
  const known = new Set(state.hello.topics.map(({ name }) => name));
  send("subscribe", { topics: [...new Set([...always, ...shown])].filter((topic) => known.has(topic)) });
}

function take({ topic, stamp_ns: stampNs, message }) {
  const name = topic.slice(prefix().length);
  if (topic === MAP) {
    state.mapImage = mapOf(message);
    state.map?.setImage(...state.mapImage);
  } else if (topic === "/tf_static") state.frames = Object.fromEntries(message.transforms.map((each) => [each.child_frame_id, each.transform]));
  else if (name === "/robot_description") state.map?.update({ outline_m: (state.outline = outlineOf(message.data)) });
  else if (name === TRUTH) showMotion(message, stampNs);
  else if (topic.endsWith(TRUTH)) state.others[topic] = poseOf(placeOf(message, stampNs));
  else if (topic in state.shown && topicsOf(HITS).includes(topic)) {
    state.hits[topic] = { points: hitsOf(message), frame: message.header.frame_id, isCloud: !message.ranges, stampNs };
    showHits();
  } else if (state.shown[topic]) showImage(topic, imageOf(message));
}

function forgetMotion() {
  state.places = [];
  state.hits = {};
  state.map?.clearTrail();
}

function showMotion(message, stampNs) {
  if (stampNs < (state.places.at(-1)?.stampNs ?? 0)) forgetMotion(); // after a reset
  const place = placeOf(message, stampNs);
  state.places = [...state.places.slice(1 - KEPT), place];
  const { linear, angular } = message.twist.twist;
  const degrees = (place.yaw * 180) / Math.PI;
  byId("speed").textContent = `${linear.x.toFixed(2)} m/s`;
  byId("turn-rate").textContent = `${angular.z.toFixed(2)} rad/s`;
  byId("place").textContent = `x ${place.x.toFixed(2)}  y ${place.y.toFixed(2)}  z ${place.z.toFixed(2)} m, yaw ${degrees.toFixed(1)}°`;
  state.nowS = 1e-9 * stampNs;
  showTime();
  state.map?.follow([place.x, place.y]);
  state.map?.update({ place: poseOf(place), others: Object.values(state.others) });
  showHits();
}

const poseOf = ({ x, y, yaw }) => ({ position_m: [x, y], yaw_deg: (yaw * 180) / Math.PI });

function showHits() {
  if (!state.places.length) return;
  const shown = Object.entries(state.hits).filter(([topic]) => state.shown[topic]);
  const hits = shown.flatMap(([, { points, frame, isCloud, stampNs }]) => onMap(points, state.frames[frame], isCloud, placeAt(state.places, stampNs)));
  state.map?.update({ hits_m: hits });
}

/** Draw the newest image of a topic; those that come while one is decoded are left out. */
async function showImage(topic, image) {
  const known = (state.images[topic] ??= { times: [], isBusy: false });
  known.times = [...known.times, performance.now()].filter((ms) => ms > performance.now() - RATE_MS);
  known.newest = image;
  if (known.isBusy) return;
  known.isBusy = true;
  try {
    while (known.newest) {
      known.last = known.newest;
      known.newest = null;
      await draw(topic);
    }
  } finally {
    known.isBusy = false;
  }
}

async function draw(topic) {
  const view = views.get(topic);
  const { last, times } = state.images[topic];
  if (!view) return;
  await view.show({ blob: last }, true);
  const rate = times.length > 1 ? ` · ${((1000 * (times.length - 1)) / (times.at(-1) - times[0])).toFixed(1)} /s` : "";
  view.detail = `${view.canvas.width} × ${view.canvas.height} px${rate}`;
  fit();
}

// Views

function showViews() {
  for (const { element } of views.values()) element.remove();
  views.clear();
  state.map = null;
  const names = imageTopics().filter((topic) => state.shown[topic]);
  if (state.shown[MAP]) names.push(MAP);
  const main = names.includes(state.main) ? state.main : names[0];
  for (const topic of names) {
    const view = new View(topic === main ? "camera" : topic, topic === MAP ? mapHooks : imageHooks, titleOf(topic));
    view.topic = topic;
    views.set(topic, view);
    if (topic === main) byId("views").prepend(view.element);
    else byId("others").append(view.element);
    if (topic === MAP) addMap(view);
    else if (state.images[topic]?.last) draw(topic);
    else view.reason = "no image yet";
  }
  byId("views").className = names.length < 2 ? "single" : names.length > 3 ? "crowd" : "";
  arranged = "";
  fit();
  const chip = (topic) => make("button", { "aria-pressed": String(state.shown[topic]), "data-topic": topic, text: titleOf(topic), title: topic, onclick: () => toggle(topic) });
  byId("chips").replaceChildren(...Object.keys(state.shown).map(chip));
  subscribe();
}

function addMap(view) {
  view.element.style.setProperty("--aspect", 4 / 3);
  state.map = new FloorMap(view);
  if (state.mapImage) state.map.setImage(...state.mapImage);
  const place = state.places.at(-1);
  state.map.update({ outline_m: state.outline, ...(place && { place: poseOf(place) }) });
  showHits();
}

function toggle(topic) {
  state.shown[topic] = !state.shown[topic];
  const saved = JSON.parse(localStorage.getItem("omnisim-streams") ?? "{}");
  localStorage.setItem("omnisim-streams", JSON.stringify({ ...saved, [topic]: state.shown[topic] }));
  showViews();
}

const imageHooks = {
  close: toggle,
  click: ({ topic }) => {
    state.main = topic;
    showViews();
  },
};
const mapHooks = {
  close: toggle,
  wheel: (view, delta, u, v) => state.map.zoom(1.0015 ** -delta, u, v),
  drag: (view, du, dv) => state.map.pan(du, dv),
};

let arranged = "";

function fit() {
  const shapes = [...views].map(([topic, { canvas }]) => `${topic} ${(canvas.width / canvas.height).toFixed(2)}`);
  const key = [innerWidth, innerHeight, ...shapes].join();
  if (key !== arranged && views.size) arrange(new Map([...views.values()].map((view) => [view.name, view])), byId("stage"), LEAST_PX);
  arranged = key;
}

// Time and clients

function showState({ now_s: nowS, wall_s: wallS, is_paused: isPaused, clients }) {
  Object.assign(state, { nowS, isPaused, clients });
  state.polled = [...state.polled, [wallS, nowS]].slice(-5);
  if (isPaused || nowS < state.polled[0][1]) state.polled = [[wallS, nowS]];
  byId("pause").setAttribute("aria-pressed", String(isPaused));
  byId("step").disabled = !isPaused;
  showTime();
  const row = ({ protocol, name, topics, dropped }) => make("tr", {},
    make("td", { class: name === state.hello.client ? "own" : "" }, name === state.hello.client ? "this page" : name, make("small", { text: protocol })),
    make("td", { text: topics.includes("*") ? "all" : String(topics.length), title: topics.join("\n") }),
    make("td", { class: dropped ? "lost" : "", text: dropped.toLocaleString("en") }),
  );
  byId("clients").tBodies[0].replaceChildren(...clients.map(row));
}

function showTime() {
  const [first, last] = [state.polled[0], state.polled.at(-1)];
  const isKnown = state.polled.length > 1 && !state.isPaused;
  const pace = isKnown ? ` · ${((last[1] - first[1]) / (last[0] - first[0])).toFixed(2)}×` : "";
  byId("time").textContent = `${state.nowS.toFixed(1)} s${state.isPaused ? " · paused" : pace}`;
}

// Buttons and keys

function listen() {
  listenToHeader();
  byId("robot").onchange = () => chooseRobot(byId("robot").value);
  const ask = (op, content) => {
    send(op, content);
    send("state");
  };
  byId("pause").onclick = () => ask("pause", { is_paused: !state.isPaused });
  byId("step").onclick = () => ask("step", { seconds: STEP_S });
  byId("reset").onclick = () => {
    ask("reset");
    if (state.isPaused) toast("The next step begins at time 0.");
  };
  for (const [key, { label, unit, value, most }] of Object.entries(LIMITS)) {
    const number = make("output", { text: value.toFixed(1) });
    const slider = make("input", { type: "range", min: "0.1", max: String(most), step: "0.1", value: String(value), "aria-label": `${label} in ${unit}` });
    slider.addEventListener("input", () => (number.textContent = (LIMITS[key].value = Number(slider.value)).toFixed(1)));
    byId("limits").append(make("div", { class: "control" }, make("label", {}, label, " ", make("small", { text: unit })), number, slider));
  }
  addEventListener("resize", fit);
  addEventListener("keydown", (event) => {
    if (isTyping(event)) return;
    const key = event.key.toLowerCase();
    if (key === "?") byId("help-dialog").showModal();
    else if (key === "p") byId("pause").click();
    else if (key === "n") byId("step").click();
  });
  setInterval(() => state.hello && send("state"), POLL_MS);
}

// State of the page, for its tests.
globalThis.omnisim = { state, views, send };
