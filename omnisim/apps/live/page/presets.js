// Presets: buttons for the gallery's cameras, optical systems and degradations.

import { byId, make } from "./dom.js";

const ICON_PX = 40; // of an image in lenses.jpg, one below the other in the order of the presets

/** @param choose receives the kind and the name of a preset. */
export function showPresets(presets, choose) {
  const lenses = make("div", { class: "lenses" }, ...presets.lens.map((name, row) => lensButton(name, row, choose)));
  const row = (kind) => make("div", { class: "row" }, ...presets[kind].map((name) => make("button", { text: name, onclick: () => choose(kind, name) })));
  byId("presets").replaceChildren(
    details("Mirrors and lenses", lenses, false),
    details("Optical systems", row("optics"), false),
    details("Imperfect cameras", row("degradation"), true),
  );
}

export function markPreset(model) {
  for (const button of document.querySelectorAll(".lenses button")) {
    const isIt = button.dataset.name === model || (button.dataset.name === "paper" && model === "hyperbolic");
    button.setAttribute("aria-pressed", String(isIt));
  }
}

function lensButton(name, row, choose) {
  const icon = make("i", { "aria-hidden": "true" });
  icon.style.backgroundPosition = `0 ${-row * ICON_PX}px`;
  const title = name === "paper" ? "paper’s mirror" : name.replaceAll("_", " ");
  return make("button", { "data-name": name, title, onclick: () => choose("lens", name) }, icon, make("span", { text: title }));
}

function details(title, body, isOpen) {
  return make("details", { open: isOpen }, make("summary", { text: title }), make("div", { class: "body" }, body));
}
