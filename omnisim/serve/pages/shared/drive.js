// Keys, gamepad and touch buttons combined to ahead, left, up, turn and tilt, from -1 to 1.

import { byId } from "./dom.js";

const KEYS = {
  w: ["ahead", 1], arrowup: ["ahead", 1], s: ["ahead", -1], arrowdown: ["ahead", -1],
  a: ["left", 1], d: ["left", -1], r: ["up", 1], f: ["up", -1],
  arrowleft: ["turn", 1], q: ["turn", 1], arrowright: ["turn", -1], e: ["turn", -1],
  t: ["tilt", -1], g: ["tilt", 1],
};
const AXES = ["ahead", "left", "up", "turn", "tilt"];
const DEAD = 0.15; // dead zone of a stick
const REPEAT_MS = 250; // the server releases keys that are not repeated

export class Drive {
  #held = new Set();
  #isFast = false;
  #send;
  #last = "";
  #isHeld = false;
  #sentMs = 0;

  constructor(send) {
    this.#send = send;
    addEventListener("keydown", (event) => this.#key(event, true));
    addEventListener("keyup", (event) => this.#key(event, false));
    addEventListener("blur", () => this.#release());
    document.addEventListener("visibilitychange", () => document.hidden && this.#release());
    for (const button of byId("pad").querySelectorAll("button")) {
      const hold = (isDown) => (event) => {
        event.preventDefault();
        if (isDown) button.setPointerCapture?.(event.pointerId);
        this.#hold(button.dataset.key, isDown);
      };
      button.addEventListener("pointerdown", hold(true));
      for (const name of ["pointerup", "pointercancel"]) button.addEventListener(name, hold(false));
      button.addEventListener("contextmenu", (event) => event.preventDefault());
    }
    setInterval(() => this.#update(), 50);
  }

  #key(event, isDown) {
    const key = event.key.toLowerCase();
    if (key === "shift") this.#isFast = isDown;
    if (!(key in KEYS) || (isDown && isTyping(event))) return;
    event.preventDefault();
    this.#hold(key, isDown);
  }

  #hold(key, isDown) {
    if (isDown) this.#held.add(key);
    else this.#held.delete(key);
    this.#update();
  }

  #release() {
    this.#held.clear();
    this.#update();
  }

  #update() {
    const command = Object.fromEntries(AXES.map((axis) => [axis, 0]));
    for (const key of this.#held) command[KEYS[key][0]] += KEYS[key][1];
    this.#addGamepad(command);
    for (const axis of AXES) command[axis] = Math.min(1, Math.max(-1, command[axis]));
    const isHeld = AXES.some((axis) => command[axis] !== 0);
    command.fast = this.#isFast ? 3 : 1;
    const text = JSON.stringify(command);
    const now = performance.now();
    if (text === this.#last && !(isHeld && now - this.#sentMs > REPEAT_MS)) return;
    const wasHeld = this.#isHeld;
    this.#last = text;
    this.#isHeld = isHeld;
    if (!isHeld && !wasHeld) return;
    this.#sentMs = now;
    this.#send("drive", command);
  }

  #addGamepad(command) {
    const pad = navigator.getGamepads?.().find((one) => one?.connected);
    if (!pad) return;
    const axis = (at) => (Math.abs(pad.axes[at] ?? 0) > DEAD ? pad.axes[at] : 0);
    command.left -= axis(0);
    command.ahead -= axis(1);
    command.turn -= axis(2);
    command.tilt += axis(3);
    command.up += (pad.buttons[7]?.value ?? 0) - (pad.buttons[6]?.value ?? 0);
  }
}

/** True if a key belongs to a shortcut or to the focused field. */
export function isTyping(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return true;
  const target = event.target;
  if (target.closest?.("dialog[open]")) return true;
  if (target.matches?.("input[type=range]")) return event.key.startsWith("Arrow");
  return Boolean(target.matches?.("input:not([type=checkbox]), select, textarea"));
}
