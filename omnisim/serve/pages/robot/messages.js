// What the page draws of ROS 2 messages: images, hits of scans and clouds, the map, poses.

const ROWS = [0.1, 2.5]; // heights above the base of the points of clouds on the map, in meters
const MAX_POINTS = 4000;
const FREE = [214, 219, 226];
const OCCUPIED = [52, 60, 72];

/** Source of a bitmap of an Image or a CompressedImage. */
export function imageOf({ format, data, encoding, width, height }) {
  if (format) return new Blob([data], { type: format.includes("png") ? "image/png" : "image/jpeg" });
  const image = new ImageData(width, height);
  image.data.fill(255);
  if (encoding === "rgb8") {
    for (let at = 0; at < width * height; at++) image.data.set(data.subarray(3 * at, 3 * at + 3), 4 * at);
    return image;
  }
  const Kind = { "16UC1": Uint16Array, "32SC1": Int32Array, "32FC1": Float32Array }[encoding];
  const values = new Kind(data.buffer);
  let largest = 1e-6;
  for (const value of values) if (Number.isFinite(value)) largest = Math.max(largest, value);
  values.forEach((value, at) => image.data.fill(Number.isFinite(value) ? (255 * value) / largest : 255, 4 * at, 4 * at + 3));
  return image;
}

/** Image of an OccupancyGrid, and the world's corners `low_m` and `high_m`. */
export function mapOf({ info, data }) {
  const { width, height, resolution, origin } = info;
  const image = new ImageData(width, height);
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      const value = data[row * width + column];
      if (value >= 0) image.data.set([...(value > 50 ? OCCUPIED : FREE), 255], 4 * ((height - 1 - row) * width + column));
    }
  }
  const low = [origin.position.x, origin.position.y];
  return [image, { low_m: low, high_m: [low[0] + width * resolution, low[1] + height * resolution] }];
}

/** Points (x, y, z) in the sensor's frame that a LaserScan or a PointCloud2 hit. */
export function hitsOf(message) {
  if (message.ranges) {
    const { ranges, angle_min: first, angle_increment: step, range_max: most } = message;
    const points = Array.from(ranges, (range, at) => [range * Math.cos(first + at * step), range * Math.sin(first + at * step), 0]);
    return points.filter((_, at) => ranges[at] > 0 && ranges[at] < most); // also no strings, as "inf"
  }
  const view = new DataView(message.data.buffer, message.data.byteOffset);
  const fields = ["x", "y", "z"].map((name) => message.fields.find((field) => field.name === name));
  const count = message.width * message.height;
  const points = [];
  for (let at = 0; at < count; at += Math.max(1, Math.floor(count / MAX_POINTS))) {
    const read = ({ offset, datatype }) => view[datatype === 8 ? "getFloat64" : "getFloat32"](at * message.point_step + offset, true);
    const point = fields.map(read);
    if (point.every(Number.isFinite)) points.push(point);
  }
  return points;
}

/** Points (x, y) in the world of points in a sensor's frame, for its transform on a base at a place. */
export function onMap(points, sensor, isCloud, { x, y, yaw }) {
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  return points.flatMap((point) => {
    const [a, b, c] = sensor ? turned(sensor.rotation, point) : point;
    const { x: ahead, y: left, z: up } = sensor?.translation ?? { x: 0, y: 0, z: 0 };
    if (isCloud && !(c + up > ROWS[0] && c + up < ROWS[1])) return [];
    return [[x + cos * (a + ahead) - sin * (b + left), y + sin * (a + ahead) + cos * (b + left)]];
  });
}

/** Vector turned by a quaternion. */
function turned({ x, y, z, w }, [a, b, c]) {
  const [p, q, r] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p];
}

/** Place of a base from its Odometry. */
export function placeOf({ pose }, stampNs) {
  const { position, orientation: q } = pose.pose;
  const yaw = Math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z));
  return { stampNs, x: position.x, y: position.y, z: position.z, yaw };
}

/** Place at a time, between those of a list in the order of their times. */
export function placeAt(places, stampNs) {
  const next = places.findIndex((place) => place.stampNs >= stampNs);
  if (next < 1) return places.at(next);
  const [one, other] = [places[next - 1], places[next]];
  const share = (stampNs - one.stampNs) / (other.stampNs - one.stampNs);
  const turn = Math.atan2(Math.sin(other.yaw - one.yaw), Math.cos(other.yaw - one.yaw));
  const between = (key) => one[key] + share * (other[key] - one[key]);
  return { stampNs, x: between("x"), y: between("y"), z: between("z"), yaw: one.yaw + share * turn };
}

/** Length and width of a robot's body, from its URDF; undefined: it has no boxes. */
export function outlineOf(urdf) {
  const boxes = [...new DOMParser().parseFromString(urdf, "text/xml").querySelectorAll("visual")].map((visual) => {
    const numbers = (tag, key) => visual.querySelector(tag).getAttribute(key).split(" ").map(Number);
    const [middle, size] = [numbers("origin", "xyz"), numbers("box", "size")];
    return [0, 1].map((axis) => Math.abs(middle[axis]) + 0.5 * size[axis]);
  });
  return boxes.length ? [0, 1].map((axis) => 2 * Math.max(...boxes.map((box) => box[axis]))) : undefined;
}
