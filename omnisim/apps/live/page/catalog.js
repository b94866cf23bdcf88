// Search box of the catalog of measured cameras: the server searches, the list shows the closest.

import { byId, make } from "./dom.js";

const PAUSE_MS = 150; // between the last key press and the search

export class Catalog {
  #ask;
  #choose;
  #box = byId("search");
  #list = byId("found");
  #cameras = [];
  #at = 0; // in the list; Enter chooses it
  #timer = 0;

  /** @param ask receives words; @param choose receives the camera that is chosen. */
  constructor(ask, choose) {
    this.#ask = ask;
    this.#choose = choose;
    this.#box.addEventListener("input", () => {
      clearTimeout(this.#timer);
      if (this.#words === "") this.show({ words: "", count: 0, cameras: [] });
      else this.#timer = setTimeout(() => this.#ask(this.#words), PAUSE_MS);
    });
    this.#box.addEventListener("keydown", (event) => this.#press(event));
  }

  get #words() {
    return this.#box.value.trim();
  }

  /** Show the answer to a search, unless the words have changed since. */
  show({ words, count, cameras }) {
    if (words !== this.#words) return;
    this.#cameras = cameras;
    const option = (camera, at) => make("li", { id: `found-${at}`, role: "option", onclick: () => this.#take(at) }, make("span", { text: camera.title }), make("small", { text: camera.detail }));
    this.#list.replaceChildren(...cameras.map(option));
    this.#list.hidden = cameras.length === 0;
    this.#box.setAttribute("aria-expanded", String(cameras.length > 0));
    const rest = count - cameras.length;
    byId("more").textContent = count === 0 ? "No camera has all of these words." : `${rest} more: add words of the model, the mode or the size, such as 4k.`;
    byId("more").hidden = words === "" || (count > 0 && rest === 0);
    this.#move(0);
  }

  #press(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (event.key === "Escape") {
      this.#box.value = "";
      this.show({ words: "", count: 0, cameras: [] });
    } else if (this.#cameras.length === 0) return;
    else if (step) this.#move((this.#at + step + this.#cameras.length) % this.#cameras.length);
    else if (event.key === "Enter") this.#take(this.#at);
    else return;
    event.preventDefault();
  }

  #move(at) {
    this.#at = at;
    [...this.#list.children].forEach((option, index) => option.setAttribute("aria-selected", String(index === at)));
    if (this.#cameras.length) this.#box.setAttribute("aria-activedescendant", `found-${at}`);
    else this.#box.removeAttribute("aria-activedescendant");
    this.#list.children[at]?.scrollIntoView({ block: "nearest" });
  }

  #take(at) {
    this.#move(at);
    this.#choose(this.#cameras[at]);
  }
}
