// Image tiles: each draws its parts, marks a point, and reports mouse input.

import { byId, make, short } from "./dom.js";

const TITLES = {
  camera: "Camera", panorama: "Panorama", perspective: "Perspective", birdseye: "Bird’s eye",
  map: "Map", range: "Range", z: "Depth z", position: "Position", normals: "Normals",
  normals_camera: "Normals, camera", albedo: "Albedo", semantic: "Classes", instance: "Instances",
  flow: "Flow", occluded: "Occlusion", flow_backward: "Backward flow",
  occluded_backward: "Backward occlusion", scene_flow: "Scene flow",
  scene_flow_camera: "Scene flow, camera", valid: "Valid", profile: "Profile",
};
export const titleOf = (name) => TITLES[name] ?? name;
const WIDE = new Set(["panorama"]);
const PROBE_MS = 40;
const GAP_PX = 12;
const CLICK_PX = 4; // a press that moves less is a click, not a drag

export class View {
  #canvas = make("canvas", { width: 4, height: 3, tabIndex: 0 });
  #mark = make("div", { class: "mark", hidden: true });
  #reason = make("div", { class: "reason", hidden: true });
  #detail = make("span", { class: "detail" });
  #legend = make("div", { class: "legend", hidden: true });
  #state = make("i", { class: "state", title: "coarse while moving, fine at rest" });
  #drag = null;
  #probedMs = 0;
  blob = null;

  /** @param hooks callbacks `probe`, `drag`, `click`, `wheel` and `close` of this view. */
  constructor(name, hooks, title = titleOf(name)) {
    this.name = name;
    this.#canvas.setAttribute("aria-label", title);
    this.#canvas.setAttribute("role", "img");
    const caption = make("figcaption", {}, make("b", { text: title }), this.#detail, make("span", { class: "spread" }));
    if (name === "camera") caption.append(this.#state, make("span"));
    else caption.append(make("button", { class: "close", "aria-label": `Hide ${title}`, text: "×", onclick: () => hooks.close(name) }));
    this.box = make("div", { class: "box" }, this.#canvas, this.#mark, this.#reason);
    this.element = make("figure", { class: `view${WIDE.has(name) ? " wide" : ""}`, "data-view": name }, caption, this.box, this.#legend);
    this.#listen(hooks);
  }

  get canvas() {
    return this.#canvas;
  }

  /** Draw a part of a message; resolves when it is displayed. */
  async show(part, isFine) {
    this.reason = part.reason;
    if (part.reason) {
      this.#canvas.getContext("2d").clearRect(0, 0, this.#canvas.width, this.#canvas.height);
      this.#legend.hidden = true;
      return;
    }
    const bitmap = await createImageBitmap(part.blob);
    if (this.#canvas.width !== bitmap.width || this.#canvas.height !== bitmap.height) {
      this.#canvas.width = bitmap.width;
      this.#canvas.height = bitmap.height;
      this.element.style.setProperty("--aspect", bitmap.width / bitmap.height);
    }
    this.#canvas.getContext("2d").drawImage(bitmap, 0, 0);
    bitmap.close();
    this.blob = part.blob;
    this.#state.classList.toggle("fine", isFine);
    if (part.legend) this.#showLegend(part.legend);
  }

  /** Text in place of the image; empty: none. */
  set reason(text) {
    this.#reason.hidden = !text;
    this.#reason.textContent = text ?? "";
  }

  set detail(text) {
    this.#detail.textContent = text;
  }

  /** Mark a position, given as shares of the sides; null hides the mark. */
  mark(place) {
    this.#mark.hidden = !place;
    if (!place) return;
    const box = this.box.getBoundingClientRect();
    const canvas = this.#canvas.getBoundingClientRect();
    this.#mark.style.left = `${canvas.left - box.left + place[0] * canvas.width}px`;
    this.#mark.style.top = `${canvas.top - box.top + place[1] * canvas.height}px`;
  }

  #showLegend(legend) {
    this.#legend.hidden = false;
    if (legend.kind === "ramp") {
      const bar = make("div");
      bar.style.background = `linear-gradient(90deg, ${legend.colors.join(", ")})`;
      const text = (value) => `${short(value, 3)} ${legend.unit}`;
      const ramp = make("div", { class: "ramp", title: `${legend.scale} scale` }, text(legend.low), bar, text(legend.high));
      this.#legend.replaceChildren(ramp);
    } else if (legend.kind === "list") {
      const items = legend.items.map((item) => {
        const swatch = make("i");
        swatch.style.background = item.color;
        return make("span", {}, swatch, item.name);
      });
      if (legend.more) items.push(make("span", { text: `and ${legend.more} more` }));
      this.#legend.replaceChildren(...items);
    } else this.#legend.replaceChildren(make("span", { text: legend.text }));
  }

  #place(event) {
    const box = this.#canvas.getBoundingClientRect();
    const share = (value, low, size) => Math.min(1, Math.max(0, (value - low) / size));
    return [share(event.clientX, box.left, box.width), share(event.clientY, box.top, box.height)];
  }

  #listen(hooks) {
    const canvas = this.#canvas;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.#drag = { x: event.clientX, y: event.clientY, moved: 0 };
    });
    canvas.addEventListener("pointermove", (event) => {
      const drag = this.#drag;
      if (drag) {
        const [dx, dy] = [event.clientX - drag.x, event.clientY - drag.y];
        drag.moved += Math.hypot(dx, dy);
        [drag.x, drag.y] = [event.clientX, event.clientY];
        const box = canvas.getBoundingClientRect();
        if (drag.moved > CLICK_PX) hooks.drag?.(this, dx / box.width, dy / box.height, event);
        return;
      }
      const now = performance.now();
      if (now - this.#probedMs < PROBE_MS) return;
      this.#probedMs = now;
      hooks.probe?.(this, ...this.#place(event));
    });
    const end = (event) => {
      if (this.#drag && this.#drag.moved <= CLICK_PX && event.type === "pointerup") hooks.click?.(this, ...this.#place(event));
      this.#drag = null;
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("pointerleave", () => hooks.leave?.(this));
    canvas.addEventListener("wheel", (event) => {
      if (!hooks.wheel) return;
      event.preventDefault();
      hooks.wheel(this, event.deltaY, ...this.#place(event));
    }, { passive: false });
  }
}

/**
 * Divide the window between the camera and the other views: as much image as fits without scrolling.
 * @param least minimum width of a column of other views.
 */
export function arrange(views, stage, least = 0) {
  const box = byId("views");
  const [width, height] = [box.clientWidth, stage.getBoundingClientRect().bottom - box.getBoundingClientRect().top - stage.scrollTop - 16];
  const shapes = [...views.values()].map(({ element, canvas, name }) => ({
    name, isWide: WIDE.has(name), aspect: canvas.width / canvas.height, rest: element.offsetHeight - canvas.offsetHeight,
  }));
  const [camera, ...others] = shapes.sort((one, other) => (other.name === "camera") - (one.name === "camera"));
  let best = null;
  for (let columns = 1; innerWidth > 760 && columns <= Math.min(3, others.length); columns++) {
    for (let side = Math.max(160, least * columns); side < width - 240; side += 4) {
      const [used, area] = column(others, side, columns);
      const shown = Math.min(width - GAP_PX - side, (height - camera.rest) * camera.aspect);
      const total = area + (shown * shown) / camera.aspect;
      if (used <= height && total > (best?.total ?? 0)) best = { columns, side, total };
    }
  }
  box.style.gridTemplateColumns = best ? `minmax(0, 1fr) ${best.side}px` : "";
  byId("others").style.gridTemplateColumns = best ? `repeat(${best.columns}, minmax(0, 1fr))` : "";
}

/** Height and image area of views in columns; wide ones take a row. */
function column(views, width, columns) {
  const narrow = (width - (columns - 1) * GAP_PX) / columns;
  let [used, area, place, row] = [-GAP_PX, 0, columns, 0];
  for (const { isWide, aspect, rest } of views) {
    const own = isWide ? width : narrow;
    if (isWide || place >= columns) [used, place, row] = [used + row + GAP_PX, 0, 0];
    [row, place] = [Math.max(row, own / aspect + rest), isWide ? columns : place + 1];
    area += (own * own) / aspect;
  }
  return [used + row, area];
}
