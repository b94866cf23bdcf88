"""Unwarped views of the page's image, the pixel under the mouse in all of them, and drawings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.live.live_messages import Gaze, ProbePoint
from omnisim.apps.live.viewpoint_motion import Place
from omnisim.cameras import CentralCamera, HyperbolicCamera, NonCentralCamera, PerspectiveCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.models.field_of_view import corner_pixels
from omnisim.cameras.optics import OpticalSystem, Surface, caustic_points
from omnisim.cameras.optics.surface import Fate
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.core.poses import pose_from_rotation, roll_pitch_yaw_from_rotation
from omnisim.ground_truth import Labels
from omnisim.perception import unwarping
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.scene import Scene
from omnisim.scene.space.floor import floor_height_m

UNWARPED = ("panorama", "perspective", "birdseye")
PANORAMA_PX, LOWEST_RAD = 720, math.radians(-45.0)
PERSPECTIVE_PX = (480, 360)
BIRDSEYE_PX, EXTENT_PER_HEIGHT = 360, 4.0
MIN_HEIGHT_M = 0.02
FINE_SAMPLES = 2  # per pixel side: a remap table takes 24 bytes per sample
_KEPT = 8  # maximum number of cached remap tables, coarse and fine
Json = dict[str, Any]


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """Image with its camera and pose, live or replayed."""

    model: CentralCamera  # model of the camera
    # (4, 4) pose of the camera's optical frame on its vehicle
    base_from_optical: Floats
    world_from_base: Floats  # (4, 4) pose of the vehicle's base
    rgb: Bytes  # (height, width, 3) uint8 sRGB
    png: bytes | None  # contents of the image file; None for a coarse image
    channels: Mapping[str, NDArray[Any]]  # ground truth by name
    labels: Labels | None  # labels of the IDs in the channels; None: no labels

    @property
    def world_from_optical(self) -> Floats:
        """Pose (4, 4) of the camera's optical frame in the world."""
        return self.world_from_base @ self.base_from_optical

    @property
    def viewpoint(self) -> Place:
        """Position of the effective viewpoint and attitude of the vehicle, as for `render`."""
        x, y, z = self.world_from_optical[:3, 3].tolist()
        angles = np.degrees(roll_pitch_yaw_from_rotation(self.world_from_base[:3, :3]))
        roll, pitch, yaw = (float(angle) + 0.0 for angle in angles)
        return Place((x, y, z), yaw, pitch, roll)


def degrees(radians: float) -> float:
    """Convert an angle to degrees, rounded to thousandths."""
    return round(math.degrees(radians), 3) + 0.0


class ViewMaker:
    """Creates views of images, and caches their remap tables while the camera stays the same."""

    def __init__(self) -> None:
        # By ID of the camera model, rotation on the vehicle, view and so on. The camera is kept as
        # well: after its deletion, another one could have its ID.
        self._tables: dict[tuple[object, ...], tuple[CentralCamera, unwarping.Unwarping]] = {}
        self._highest: dict[tuple[object, ...], tuple[CentralCamera, float]] = {}

    def view(self, name: str, frame: LiveFrame, gaze: Gaze, height_m: float) -> unwarping.View:
        """Virtual camera of a view, with its rotation.

        Args:
            name: one of `UNWARPED`.
            frame: image to unwarp.
            gaze: direction of the perspective view.
            height_m: height of the viewpoint above the ground.

        Raises:
            OpticsError: the camera does not see the horizon, so it has no panorama.
        """
        if name == "panorama":
            rotation = frame.base_from_optical[:3, :3]
            key = id(frame.model), rotation.tobytes()
            if key not in self._highest:
                if len(self._highest) >= _KEPT:
                    self._highest.clear()
                highest_rad = math.radians(
                    max(unwarping.highest_elevation_deg(frame.model, rotation), 5.0)
                )
                self._highest[key] = (frame.model, highest_rad)
            return unwarping.cylinder_view(PANORAMA_PX, LOWEST_RAD, self._highest[key][1])
        if name == "perspective":
            fov_rad, yaw_rad, pitch_rad = np.radians((gaze.fov_deg, gaze.yaw_deg, gaze.pitch_deg))
            return unwarping.perspective_view(*PERSPECTIVE_PX, fov_rad, yaw_rad, pitch_rad)
        height_m = max(height_m, MIN_HEIGHT_M)
        return unwarping.birdseye_view(BIRDSEYE_PX, EXTENT_PER_HEIGHT * height_m, height_m)

    def image(
        self, name: str, frame: LiveFrame, gaze: Gaze, height_m: float, is_fine: bool
    ) -> Bytes:
        """Unwarped image (height, width, 3) of a view; arguments as for `view`.

        Fine images have four samples per pixel.

        Raises:
            OpticsError: the camera sees nothing of the view, or it is non-central.
        """
        rotation = frame.base_from_optical[:3, :3]
        numbers: tuple[float, ...] = ()
        if name == "perspective":
            numbers = (gaze.yaw_deg, gaze.pitch_deg, gaze.fov_deg)
        # no height in the key of a map: its extent grows with the height, so its table is the same
        key = id(frame.model), rotation.tobytes(), name, numbers, is_fine
        if key not in self._tables:
            view = self.view(name, frame, gaze, height_m)
            if len(self._tables) >= _KEPT:
                del self._tables[next(iter(self._tables))]
            rotation_in, samples = rotation.T @ view.base_from_view, FINE_SAMPLES if is_fine else 1
            table = unwarping.Unwarping(frame.model, view.camera, rotation_in, samples=samples)
            self._tables[key] = (frame.model, table)
        return self._tables[key][1](frame.rgb)


def direction_in(view: unwarping.View, u: float, v: float) -> Floats:
    """Direction (3,) of a view's ray, base frame; u and v are shares of the width and height.

    Raises:
        OpticsError: no ray at (u, v).
    """
    pixel = np.array((u * view.camera.width_px - 0.5, v * view.camera.height_px - 0.5))
    rays = view.camera.ray_from_pixel(pixel)
    if not rays.valid:
        raise OpticsError("no ray here: outside the lens or mirror")
    return view.base_from_view @ rays.directions


def place_in(view: unwarping.View, direction: Floats) -> tuple[float, float] | None:
    """Position of a direction (3,), base frame, in a view; None: outside.

    The position (u, v) is given as shares of the view's width and height.
    """
    pixels = view.camera.pixel_from_ray(view.base_from_view.T @ direction)
    u, v = ((pixels.positions_px + 0.5) / (view.camera.width_px, view.camera.height_px)).tolist()
    return (u, v) if pixels.valid and 0.0 <= u <= 1.0 and 0.0 <= v <= 1.0 else None


def probe(
    message: ProbePoint, frame: LiveFrame, views: ViewMaker, gaze: Gaze, height_m: float
) -> dict[str, Any]:
    """Answer a probe with JSON-serializable values.

    `yaw_deg` and `pitch_deg` are relative to the vehicle; `direction` is in the world. `pixel` and
    `color` refer to the camera's image. `range_m`, `class`, `instance` and `point_m` are present
    if the channel is. `marks` has the position in each view, as shares of its width and height.
    Without a ray there is only a `reason`.

    Args:
        frame: image with ground-truth channels.
        views: maker of the unwarped views.
        gaze: direction of the perspective view.
        height_m: height of the viewpoint above the ground.
    """
    if message.view == "map":
        return {"marks": {}}
    cameras = {"camera": unwarping.View(frame.model, frame.base_from_optical[:3, :3])}
    is_central = not isinstance(frame.model, NonCentralCamera)
    for name in UNWARPED if is_central else ():
        try:
            cameras[name] = views.view(name, frame, gaze, height_m)
        except OmnisimError:  # this camera lacks the view
            continue
    source = cameras.get(message.view, cameras["camera"])
    try:
        direction = direction_in(source, message.u, message.v)
    except OpticsError as reason:
        return {"view": message.view, "reason": str(reason), "marks": {}}
    own = (message.u, message.v) if source is cameras["camera"] else None
    if own is None and is_central:
        own = place_in(cameras["camera"], direction)
    marks: dict[str, tuple[float, float]] = {}
    if own is not None:
        # the values of the channels belong to the ray through the pixel's center
        height, width = frame.rgb.shape[:2]
        column, row = min(int(own[0] * width), width - 1), min(int(own[1] * height), height - 1)
        marks["camera"] = (column + 0.5) / width, (row + 0.5) / height
        with suppress(OpticsError):  # the pixel's center may be outside the rim
            direction = direction_in(cameras["camera"], *marks["camera"])
    for name, camera in cameras.items():
        if name != "camera" and (place := place_in(camera, direction)) is not None:
            marks[name] = place
    world = frame.world_from_base[:3, :3] @ direction
    answer: Json = {
        "view": message.view,
        "yaw_deg": degrees(math.atan2(direction[1], direction[0])),
        "pitch_deg": degrees(math.atan2(-direction[2], math.hypot(direction[0], direction[1]))),
        "direction": np.round(world, 5).tolist(),
        "marks": marks,
    }
    if own is not None:
        answer |= {"pixel": [column, row], "color": frame.rgb[row, column].tolist()}
        channels, labels = frame.channels, frame.labels
        if "range" in channels:
            range_m = float(channels["range"][row, column])
            answer["range_m"] = round(range_m, 4) if math.isfinite(range_m) else None
        if "position" in channels:
            point = channels["position"][row, column].astype(np.float64)
            is_known = bool(np.all(np.isfinite(point)))
            answer["point_m"] = np.round(point, 4).tolist() if is_known else None
        if labels is not None and "semantic" in channels:
            number = int(channels["semantic"][row, column])
            names = {kind.id: kind.name for kind in labels.classes}
            answer["class"] = names.get(number)
        if labels is not None and "instance" in channels:
            number = int(channels["instance"][row, column])
            answer["instance"] = labels.instances[number - 1].name if number else None
    return answer


# Drawings beside the image: the scene's map from above, and a section of the camera.


CUT_M = 0.95  # height of the cut above the ground, so that higher parts do not hide the floor
LONGER_SIDE_PX = 1000
REACH_M = 20.0  # extent around the viewpoint if the scene names no places
MARGIN_M = 6.0  # margin around the scene's named places
_WORLD_FROM_OPTICAL = np.diag([1.0, -1.0, -1.0])  # looks down; the world's y is up in the image
DISTANCE = 30.0  # camera distance in units of the longer side: rays are nearly parallel
RAYS = 15
_POINTS = 81  # points per curve


@dataclass(frozen=True, eq=False)
class FloorMap:
    """Image of a scene from above, x to the right and y up."""

    rgb: Bytes  # (height, width, 3) uint8 sRGB
    # (2,) minimum and maximum x and y of the image in the world
    low_m: Floats
    high_m: Floats
    ground_m: float  # height (z) of the ground in the world


def draw_floor_map(stage: Stage, near_m: tuple[float, float, float]) -> FloorMap:
    """Draw the map of a stage's scene around the point `near_m`.

    Raises:
        OmnisimError: the GPU cannot render the map.
    """
    scene = stage.scene
    ground_m = ground_height_m(scene, near_m)
    # around starts, landmarks, paths and the viewpoint; around this alone if they are far apart
    places = [start.position_m[:2] for start in scene.starts]
    places += [landmark.position_m[:2] for landmark in scene.landmarks]
    places += [point[:2] for path in scene.paths for point in path.waypoints_m]
    named = np.array([*places, near_m[:2]], dtype=np.float64)
    is_near = bool(places) and float(np.ptp(named, axis=0).max()) < 10.0 * REACH_M
    at, reach_m = (named, MARGIN_M) if is_near else (named[-1:], REACH_M)
    low, high = scene.bounds_m()[:, :2]
    low, high = np.minimum(low, near_m[:2]) - 0.3, np.maximum(high, near_m[:2]) + 0.3
    low_m = np.maximum(low, at.min(axis=0) - reach_m)
    high_m = np.minimum(high, at.max(axis=0) + reach_m)
    side_m = float((high_m - low_m).max())
    distance_m, pixels_per_m = DISTANCE * side_m, LONGER_SIDE_PX / side_m
    width_px, height_px = (max(1, round(float(m) * pixels_per_m)) for m in high_m - low_m)
    center_px = 0.5 * (width_px - 1), 0.5 * (height_px - 1)
    camera = PerspectiveCamera(width_px, height_px, distance_m * pixels_per_m, center_px)
    looking = _WORLD_FROM_OPTICAL @ camera.rig_from_optical.T
    sensor = OmniCamera(
        camera, polygons=None, near_m=distance_m - CUT_M, supersampling=2, texels_per_pixel=1.5
    )
    middle_m = 0.5 * (low_m + high_m)
    base = pose_from_rotation(looking, (*middle_m, ground_m + distance_m))
    hidden = {each.name for body in stage.vehicles.values() for each in body.instances}
    with stage.open(sensor, hidden=hidden) as renderer:
        frame = renderer.render(base)
    half_m = 0.5 * np.array((width_px, height_px)) / pixels_per_m
    return FloorMap(frame.rgb, middle_m - half_m, middle_m + half_m, ground_m)


def ground_height_m(scene: Scene, near_m: tuple[float, float, float]) -> float:
    """Height (z) of the floor below a viewpoint; without a floor, of the scene's lowest point."""
    floor_m = floor_height_m(scene, near_m[:2], near_m[2] - 0.5 * CUT_M)
    if floor_m is not None and math.isfinite(floor_m) and floor_m <= near_m[2]:
        return floor_m
    return float(min(scene.bounds_m()[0, 2], near_m[2]))


def profile(model: CentralCamera) -> Json:
    """Lines of a camera as JSON-serializable values.

    `kind` is "section" or "mapping". A section has `curves`, `rays`, `caustic` and `pinhole`, of
    points (x, z) in millimeters, z along the camera's axis. A mapping has `points` with an angle in
    degrees and a radius in pixels.
    """
    if isinstance(model, HyperbolicCamera):
        return _mirror(model.mirror)
    return _system(model) if isinstance(model, OpticalSystem) else _mapping(model)


def _mirror(mirror: HyperbolicMirror) -> Json:
    theta = np.linspace(-mirror.theta_max_rad, mirror.theta_max_rad, _POINTS)
    curve = _incident(mirror, theta)
    directions = np.linspace(-0.98 * mirror.theta_max_rad, 0.98 * mirror.theta_max_rad, RAYS)
    hits = _incident(mirror, directions)
    pinhole = np.array((0.0, -mirror.c_m))
    reach_m = 2.2 * max(mirror.rim_radius_m, 0.3 * mirror.c_m)
    outward = np.stack((np.sin(directions), -np.cos(directions)), axis=-1)
    rays = [
        _line(np.stack((pinhole, hit, hit + reach_m * out)))
        for hit, out in zip(hits, outward, strict=True)
    ]
    return {
        "kind": "section",
        "curves": [{"kind": "mirror", "points": _line(curve)}],
        "rays": rays,
        "caustic": [[0.0, 0.0]],
        "pinhole": _line(pinhole[None])[0],
    }


def _incident(mirror: HyperbolicMirror, theta_rad: Floats) -> Floats:
    """Points (x, z) (n, 2) of the mirror, m, z up, at angles of incidence from straight down."""
    rho = mirror.rho_m(np.abs(theta_rad))
    # behind the surface: the viewpoint is inside the mirror, and rays arrive from outside
    return np.stack((rho * np.sin(theta_rad), -rho * np.cos(theta_rad)), axis=-1)


def _system(system: OpticalSystem) -> Json:
    def row(count: int) -> Floats:
        u = np.linspace(0.0, system.width_px - 1.0, count)
        return np.column_stack((u, np.full(count, system.principal_point_px[1])))

    paths = system.paths(row(RAYS))
    seen = paths.fates == Fate.SEEN
    hits = paths.points_m[:, seen].reshape(-1, 3)
    curves = [
        {"kind": "mirror" if each.is_mirror else "boundary", "points": _line(_curve(each, hits))}
        for each in system.surfaces
    ]
    drawn = hits[:, [0, 2]]
    size_m = float(np.ptp(drawn, axis=0).max()) if len(drawn) else 0.1
    ends = paths.points_m[-1] + 0.8 * size_m * paths.directions
    rays = [
        _line(np.concatenate((paths.points_m[:, ray], ends[ray : ray + 1]))[:, [0, 2]])
        for ray in np.flatnonzero(seen)
    ]
    caustic = (caustic_points(system, row(120)) + system.origin_m).reshape(-1, 3)[:, [0, 2]]
    caustic = caustic[np.all(np.abs(caustic) < 20.0 * size_m, axis=1)]
    return {
        "kind": "section",
        "curves": curves,
        "rays": rays,
        "caustic": _line(caustic),
        "pinhole": _line(system.system_from_camera[None, [0, 2], 3])[0],
    }


def _curve(surface: Surface, hits_m: Floats) -> Floats:
    """Section (n, 2) of a surface with its own plane y = 0, as (x, z) in m, system frame.

    `hits_m` (n, 3) are points of rays; they set the width of a surface without an edge.
    """
    reach_m = surface.visible_radius_m
    if math.isinf(reach_m):
        local = surface.points_from_system(hits_m)
        reach_m = 1.2 * float(np.hypot(local[:, 0], local[:, 1]).max(initial=1e-3))
    x = np.linspace(-reach_m, reach_m, _POINTS)
    z = surface.shape.sag_m(np.abs(x))
    points = surface.directions_to_system(np.column_stack((x, np.zeros_like(x), z)))
    return (points + surface.system_from_surface[:3, 3])[:, [0, 2]]


def _mapping(model: CentralCamera) -> Json:
    """Mapping of a lens, to the first degree beyond its image: radius, px, over angle from axis."""
    theta = np.linspace(0.0, math.pi, 181)
    directions = np.stack((np.sin(theta), np.zeros_like(theta), np.cos(theta)), axis=-1)
    pixels = model.pixel_from_ray(directions)
    middle = getattr(model, "principal_point_px", (0.5 * model.width_px, 0.5 * model.height_px))
    radii = np.hypot(*(pixels.positions_px - middle).T)
    shown = pixels.valid & (radii <= np.hypot(*(corner_pixels(model) - middle).T).max())
    shown[1:] |= shown[:-1].copy()
    shown &= pixels.valid & np.isfinite(radii)
    points = np.column_stack((np.degrees(theta), radii))[shown]
    return {"kind": "mapping", "points": np.round(points, 2).tolist()}


def _line(points_m: Floats) -> list[list[float]]:
    """Convert points (n, 2) to millimeters, as a list without non-finite points."""
    finite = points_m[np.all(np.isfinite(points_m), axis=1)]
    return np.round(1e3 * finite, 3).tolist()
