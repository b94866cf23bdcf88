// Controls of the camera's parameters, from groups that the server generates from its schemas.

import { byId, make, short } from "./dom.js";

const STEPS = 1000; // positions of a slider

export class Controls {
  #set;
  #rows = new Map();
  #shape = "";
  #open = new Set(["Mirror", "Lens", "Camera"]);

  /** @param set receives the path of a key and its value; null removes the key. */
  constructor(set) {
    this.#set = set;
  }

  show(groups) {
    const shape = JSON.stringify(groups, (name, value) => (["value", "effective", "soft", "choices"].includes(name) ? undefined : value));
    if (shape !== this.#shape) {
      this.#shape = shape;
      this.#rows.clear();
      const title = make("h2", { text: "Parameters" });
      byId("controls").replaceChildren(title, ...groups.map((group) => this.#group(group, "")));
    }
    for (const control of allControls(groups)) this.#rows.get(control.path)?.update(control);
  }

  /** Show the values in use again, after one was refused. */
  restore() {
    for (const row of this.#rows.values()) row.update();
  }

  #group(group, above) {
    const key = above + group.title;
    const summary = make("summary");
    if (group.switch) {
      const box = make("input", { type: "checkbox", checked: group.on, "aria-label": group.title });
      box.addEventListener("click", (event) => event.stopPropagation());
      box.addEventListener("change", () => this.#set(group.switch, box.checked ? {} : null));
      summary.append(box);
      if (group.on) this.#open.add(key);
    }
    summary.append(group.title);
    const body = make("div", { class: "body" });
    if (group.help) body.append(make("p", { class: "about", text: group.help }));
    for (const control of group.controls) {
      const row = new Row(control, this.#set);
      this.#rows.set(control.path, row);
      body.append(row.element);
    }
    const element = make("details", { open: this.#open.has(key) }, summary, body);
    body.append(...group.groups.map((inner) => this.#group(inner, `${key}/`)));
    element.addEventListener("toggle", () => this.#open[element.open ? "add" : "delete"](key));
    return element;
  }
}

function allControls(groups) {
  return groups.flatMap((group) => [...group.controls, ...allControls(group.groups)]);
}

let counter = 0;

class Row {
  #control;
  #set;
  #inputs = [];
  #slider = null;
  #soft = null;

  constructor(control, set) {
    this.#control = control;
    this.#set = set;
    this.#soft = control.soft;
    const id = `control-${++counter}`;
    const label = make("label", { for: id, title: control.path.replace(/^\w+\./, "") }, control.label.replace(/_(m|px|deg|s|e|hz)$/, "").replaceAll("_", " "));
    if (control.unit) label.append(" ", make("small", { text: control.unit }));
    label.addEventListener("click", () => this.element.classList.toggle("told"));
    const field = make("div", { class: "field" });
    if (!control.required) field.append(make("button", { class: "unset", title: "Back to the default", "aria-label": `${control.label}: default`, text: "↺", onclick: () => set(control.path, null) }));
    this.element = make("div", { class: "control", "data-path": control.path }, label, field);
    if (control.kind === "vector") this.#addVector(id);
    else field.append(this.#field(id));
    if (control.soft && control.kind !== "vector") this.#addSlider();
    const hint = [control.help, limits(control)].filter(Boolean).join(" ");
    if (hint) {
      this.element.append(make("p", { class: "hint", id: `${id}-hint`, text: hint }));
      for (const input of this.#inputs) input.setAttribute("aria-describedby", `${id}-hint`);
    }
  }

  update(control = this.#control) {
    this.#control = control;
    this.element.classList.toggle("given", control.value !== null);
    const shown = control.value ?? control.effective ?? control.default;
    if (control.kind === "vector") {
      this.#inputs.forEach((input, at) => setUnlessFocused(input, Array.isArray(shown) ? short(shown[at], 7) : ""));
    } else if (control.kind === "boolean") this.#inputs[0].checked = Boolean(shown);
    else if (control.kind === "choice") this.#inputs[0].value = shown === null ? "" : String(shown);
    else setUnlessFocused(this.#inputs[0], short(shown, 7));
    if (this.#slider && typeof shown === "number" && document.activeElement !== this.#slider) this.#slider.value = this.#step(shown);
    if (!this.#control.choices.length || !this.#inputs[0]) return;
    this.#inputs[0].title = control.value === null ? `default: ${control.default ?? "derived from other keys"}` : "";
  }

  #field(id) {
    const { kind, choices, required } = this.#control;
    let input;
    if (kind === "choice") {
      input = make("select", { id }, ...[...(required ? [] : [""]), ...choices].map((word) => make("option", { value: String(word), text: word === "" ? "default" : String(word) })));
      input.addEventListener("change", () => this.#set(this.#control.path, input.value === "" ? null : choices.find((word) => String(word) === input.value)));
    } else if (kind === "boolean") {
      input = make("input", { id, type: "checkbox" });
      input.addEventListener("change", () => this.#set(this.#control.path, input.checked));
    } else if (kind === "text" || choices.length) {
      input = make("input", { id, type: "text", spellcheck: false, autocomplete: "off" });
      if (choices.length) {
        const list = make("datalist", { id: `${id}-list` }, ...choices.map((word) => make("option", { value: String(word) })));
        input.setAttribute("list", list.id);
        this.element?.append(list);
      }
      input.addEventListener("change", () => this.#setText(input.value));
    } else {
      input = make("input", { id, type: "number", step: kind === "integer" ? 1 : "any" });
      input.addEventListener("change", () => this.#setText(input.value));
    }
    this.#inputs.push(input);
    return input;
  }

  #addVector(id) {
    const box = make("div", { class: "vector" });
    for (let at = 0; at < this.#control.length; at++) {
      const input = make("input", { type: "number", step: "any", id: at ? `${id}-${at}` : id, "aria-label": `${this.#control.label} ${at + 1}` });
      input.addEventListener("change", () => {
        const values = this.#inputs.map((one) => Number(one.value || 0));
        this.#set(this.#control.path, values);
      });
      this.#inputs.push(input);
      box.append(input);
    }
    this.element.append(box);
  }

  #addSlider() {
    const slider = make("input", { type: "range", min: 0, max: STEPS, tabIndex: 0, "aria-label": this.#control.label });
    slider.addEventListener("input", () => {
      const value = this.#value(Number(slider.value));
      setUnlessFocused(this.#inputs[0], short(value, 5));
      this.#set(this.#control.path, value);
    });
    this.#slider = slider;
    this.element.append(slider);
  }

  #value(step) {
    const { low, high, log } = this.#soft;
    const share = step / STEPS;
    const value = log ? low * (high / low) ** share : low + share * (high - low);
    return this.#control.kind === "integer" ? Math.round(value) : Number(value.toPrecision(4));
  }

  #step(value) {
    const { low, high, log } = this.#soft;
    const share = log ? Math.log(Math.max(value, 1e-12) / low) / Math.log(high / low) : (value - low) / (high - low);
    return Math.round(STEPS * Math.min(1, Math.max(0, share)));
  }

  #setText(text) {
    const trimmed = text.trim();
    const number = Number(trimmed);
    const isNumber = trimmed !== "" && Number.isFinite(number);
    this.#set(this.#control.path, trimmed === "" ? null : isNumber && this.#control.kind !== "text" ? number : trimmed);
  }
}

function setUnlessFocused(input, text) {
  if (document.activeElement !== input && input.value !== text) input.value = text;
}

function limits({ low, high, low_open: lowOpen, high_open: highOpen, choices }) {
  const parts = [];
  if (low !== null) parts.push(`${lowOpen ? ">" : "≥"} ${short(low)}`);
  if (high !== null) parts.push(`${highOpen ? "<" : "≤"} ${short(high)}`);
  if (choices.length && parts.length) parts.push(`or ${choices.join(", ")}`);
  return parts.length ? `(${parts.join(", ")})` : "";
}
