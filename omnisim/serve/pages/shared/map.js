// Map from above: the scene's image with the robot, its path, and the area the camera sees.

const TRAIL = 2000; // maximum number of points
const TRAIL_STEP_M = 0.03;
const WIDTH = 720;

export class FloorMap {
  #image = null;
  #low = [0, 0];
  #high = [1, 1];
  #center = [0, 0];
  #pixelsPerM = 40;
  #trail = [];
  #state = {};

  constructor(view) {
    this.view = view;
    view.canvas.width = WIDTH;
    view.canvas.height = Math.round(WIDTH * 0.75);
  }

  /** @param image source of a bitmap between the world's corners `low_m` and `high_m`. */
  async setImage(image, { low_m: low, high_m: high }) {
    const isFirst = this.#image === null;
    this.#image = await createImageBitmap(image);
    [this.#low, this.#high] = [low, high];
    if (isFirst) this.fit();
    this.view.reason = "";
    this.draw();
  }

  fit() {
    const { width, height } = this.view.canvas;
    const size = [this.#high[0] - this.#low[0], this.#high[1] - this.#low[1]];
    this.#center = [0.5 * (this.#low[0] + this.#high[0]), 0.5 * (this.#low[1] + this.#high[1])];
    this.#pixelsPerM = Math.min(width / size[0], height / size[1]);
  }

  /** @param state changed values among `place`, `seen_m`, `outline_m`, `driven_m`, `goal`, `point`, `hits_m`, `others`. */
  update(state) {
    Object.assign(this.#state, state);
    if (state.place) this.#extendTrail(state.place.position_m);
    this.draw();
  }

  clearTrail() {
    this.#trail = [];
  }

  zoom(factor, u, v) {
    const at = this.world(u, v);
    this.#pixelsPerM = Math.min(2000, Math.max(0.5, this.#pixelsPerM * factor));
    const now = this.world(u, v);
    this.#center = [this.#center[0] + at[0] - now[0], this.#center[1] + at[1] - now[1]];
    this.draw();
  }

  /** Look at a world point (x, y), where there is no image. */
  follow([x, y]) {
    if (!this.#image) this.#center = [x, y];
  }

  pan(du, dv) {
    const { width, height } = this.view.canvas;
    this.#center[0] -= (du * width) / this.#pixelsPerM;
    this.#center[1] += (dv * height) / this.#pixelsPerM;
    this.draw();
  }

  /** World point (x, y) in meters at a map position, given as shares of the sides. */
  world(u, v) {
    const { width, height } = this.view.canvas;
    return [
      this.#center[0] + ((u - 0.5) * width) / this.#pixelsPerM,
      this.#center[1] - ((v - 0.5) * height) / this.#pixelsPerM,
    ];
  }

  /** Map position of a world point (x, y), as shares of the sides. */
  place(point) {
    const { width, height } = this.view.canvas;
    const [x, y] = this.#pixel(point);
    return [x / width, y / height];
  }

  #pixel([x, y]) {
    const { width, height } = this.view.canvas;
    return [
      0.5 * width + (x - this.#center[0]) * this.#pixelsPerM,
      0.5 * height - (y - this.#center[1]) * this.#pixelsPerM,
    ];
  }

  #extendTrail([x, y]) {
    const last = this.#trail.at(-1);
    if (last && Math.hypot(x - last[0], y - last[1]) < TRAIL_STEP_M) return;
    this.#trail.push([x, y]);
    if (this.#trail.length > TRAIL) this.#trail.shift();
  }

  draw() {
    const context = this.view.canvas.getContext("2d");
    const { width, height } = this.view.canvas;
    context.clearRect(0, 0, width, height);
    if (this.#image) {
      const [left, top] = this.#pixel([this.#low[0], this.#high[1]]);
      const [right, bottom] = this.#pixel([this.#high[0], this.#low[1]]);
      context.imageSmoothingQuality = "high";
      context.drawImage(this.#image, left, top, right - left, bottom - top);
    }
    const { place, seen_m: seen, driven_m: driven, goal, point, hits_m: hits, others } = this.#state;
    if (seen?.length) {
      this.#line(context, seen);
      context.closePath();
      context.fillStyle = "rgb(255 255 255 / .16)";
      context.strokeStyle = "rgb(255 255 255 / .75)";
      context.lineWidth = 1.2;
      context.fill();
      context.stroke();
    }
    if (driven?.length > 1) this.#stroke(context, driven, "rgb(255 190 60 / .9)", 2.5);
    if (this.#trail.length > 1) this.#stroke(context, this.#trail, "rgb(20 184 166 / .95)", 3);
    for (const hit of hits ?? []) {
      const [x, y] = this.#pixel(hit);
      context.fillStyle = "#ff3d71";
      context.fillRect(x - 1.5, y - 1.5, 3, 3);
    }
    if (goal) this.#dot(context, goal, 6, "rgb(20 184 166)", true);
    for (const other of others ?? []) this.#vehicle(context, other, null, "#8b5cf6");
    if (place) this.#vehicle(context, place, this.#state.outline_m);
    if (point) this.#dot(context, point, 7, "#ff3d71", true);
  }

  #line(context, points) {
    context.beginPath();
    points.forEach((point, at) => context[at ? "lineTo" : "moveTo"](...this.#pixel(point)));
  }

  #stroke(context, points, color, width) {
    this.#line(context, points);
    context.strokeStyle = color;
    context.lineWidth = width;
    context.lineJoin = "round";
    context.stroke();
  }

  #dot(context, point, radius, color, isRing) {
    context.beginPath();
    context.arc(...this.#pixel(point), radius, 0, 2 * Math.PI);
    context.lineWidth = 2.5;
    context.strokeStyle = context.fillStyle = color;
    if (isRing) context.stroke();
    else context.fill();
  }

  #vehicle(context, place, outline, color = "#14b8a6") {
    context.save();
    context.translate(...this.#pixel(place.position_m));
    context.rotate((-place.yaw_deg * Math.PI) / 180);
    context.fillStyle = color;
    context.strokeStyle = "#ffffff";
    context.lineWidth = 2;
    if (outline) {
      const [length, width] = outline.map((side) => side * this.#pixelsPerM);
      context.beginPath();
      context.roundRect(-length / 2, -width / 2, length, width, Math.min(length, width) / 5);
      context.globalAlpha = 0.85;
      context.fill();
      context.globalAlpha = 1;
      context.stroke();
    }
    const size = 11;
    context.beginPath();
    context.moveTo(size, 0);
    context.lineTo(-size * 0.7, size * 0.7);
    context.lineTo(-size * 0.35, 0);
    context.lineTo(-size * 0.7, -size * 0.7);
    context.closePath();
    context.fillStyle = outline ? "#ffffff" : color;
    context.fill();
    if (!outline) context.stroke();
    context.restore();
  }
}
