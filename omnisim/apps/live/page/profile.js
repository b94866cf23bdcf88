// Section of a mirror or optical system with its rays, or the mapping of a lens, as SVG.

import { makeSvg } from "./dom.js";

const WIDTH = 300;
const HEIGHT = 190;
const MARGIN = 12;

export function drawProfile(svg, profile) {
  svg.replaceChildren();
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  if (profile.kind === "mapping") drawMapping(svg, profile.points);
  else drawSection(svg, profile);
}

function drawSection(svg, { curves, rays, caustic, pinhole }) {
  const inner = rays.map((ray) => ray.slice(0, -1)).flat();
  const points = [...curves.flatMap((curve) => curve.points), ...inner, pinhole];
  const [xs, zs] = [points.map((p) => p[0]), points.map((p) => p[1])];
  const [low, high] = [[Math.min(...xs), Math.min(...zs)], [Math.max(...xs), Math.max(...zs)]];
  const scale = Math.min((WIDTH - 6 * MARGIN) / (high[0] - low[0] || 1), (HEIGHT - 3 * MARGIN) / (high[1] - low[1] || 1));
  const middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
  const at = ([x, z]) => `${(WIDTH / 2 + (x - middle[0]) * scale).toFixed(1)},${(HEIGHT / 2 - (z - middle[1]) * scale).toFixed(1)}`;
  for (const ray of rays) svg.append(makeSvg("polyline", { class: "ray", points: ray.map(at).join(" ") }));
  for (const curve of curves) svg.append(makeSvg("polyline", { class: curve.kind, points: curve.points.map(at).join(" ") }));
  for (const point of caustic) {
    const [cx, cy] = at(point).split(",");
    svg.append(makeSvg("circle", { class: "caustic", cx, cy, r: caustic.length > 1 ? 1.3 : 3.2 }));
  }
  const [cx, cy] = at(pinhole).split(",");
  svg.append(makeSvg("circle", { class: "pinhole", cx, cy, r: 3.2 }));
  drawScale(svg, scale);
}

function drawScale(svg, pixelsPerMm) {
  const wanted = 60 / pixelsPerMm;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const length = [1, 2, 5].map((n) => n * power).filter((n) => n <= wanted).pop() ?? power;
  const y = HEIGHT - 8;
  svg.append(makeSvg("path", { class: "axis", d: `M${MARGIN},${y}h${length * pixelsPerMm}`, "stroke-width": 2 }));
  svg.append(makeSvg("text", { x: MARGIN, y: y - 5 }, `${Number(length.toPrecision(2))} mm`));
}

function drawMapping(svg, points) {
  if (points.length < 2) return;
  const [left, bottom] = [40, HEIGHT - 24];
  const largest = [Math.max(...points.map((p) => p[0])), Math.max(...points.map((p) => p[1]))];
  const x = (angle) => left + (angle / largest[0]) * (WIDTH - left - MARGIN);
  const y = (radius) => bottom - (radius / largest[1]) * (bottom - MARGIN);
  svg.append(makeSvg("path", { class: "axis", d: `M${left},${MARGIN}V${bottom}H${WIDTH - MARGIN}` }));
  svg.append(makeSvg("polyline", { class: "mirror", points: points.map((p) => `${x(p[0]).toFixed(1)},${y(p[1]).toFixed(1)}`).join(" ") }));
  svg.append(makeSvg("text", { x: WIDTH - MARGIN, y: HEIGHT - 9, "text-anchor": "end" }, `angle to ${largest[0]}°`));
  svg.append(makeSvg("text", { x: left - 5, y: MARGIN + 6, "text-anchor": "end" }, `${Math.round(largest[1])} px`));
  svg.append(makeSvg("text", { x: left - 5, y: bottom, "text-anchor": "end" }, "0"));
}
