// Creation of elements in single expressions, and other small helpers.

export const byId = (id) => document.getElementById(id);

/** Create an element with attributes and children; `on…` are listeners, `text` is its text. */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "text") element.textContent = value;
    else if (name in element && typeof value !== "string") element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

export function makeSvg(tag, attributes = {}, text = "") {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text) element.textContent = text;
  return element;
}

/** Format a number with few digits: 0.04, 11.546, 1448. */
export function short(value, digits = 4) {
  if (typeof value !== "number") return String(value ?? "");
  return String(Number(value.toPrecision(digits)));
}

let toastTimer = 0;
export function toast(text) {
  const element = byId("toast");
  element.textContent = text;
  element.hidden = false;
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => (element.hidden = true), 3200);
}

/** Buttons of every page: light or dark, and the help. */
export function listenToHeader() {
  const theme = localStorage.getItem("omnisim-theme");
  if (theme) document.documentElement.dataset.theme = theme;
  byId("theme").onclick = () => {
    const isDark = getComputedStyle(document.documentElement).colorScheme === "dark";
    const next = isDark ? "light" : "dark";
    document.documentElement.dataset.theme = next;
    localStorage.setItem("omnisim-theme", next);
  };
  byId("help").onclick = () => byId("help-dialog").showModal();
}

export function download(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
