"""Comparison of both back ends with own rays, pixel by pixel and beam by beam."""

import itertools
from collections import Counter

import numpy as np

from omnisim.cameras import HyperbolicCamera, NonCentralCamera, period_px, pixel_grid
from omnisim.cameras.mirrors import tessellate
from omnisim.cameras.mirrors.hyperbolic import mesh_rays
from omnisim.core.world import WorldState
from omnisim.rendering.stage import Stage
from tests.chance.worlds import OwnRays, placed

BACKENDS = ("cube", "rays")
CHANNELS = ("range", "instance", "normals", "flow", "valid")
STEP_S = 0.05  # between an image and the next
# A ray of the GPU is off by a float's rounding, which folds magnify, in radians; points by some of
# it in meters, as from a scene's origin.
RAY_RAD, POINT_M = 1e-5, 1e-5
MAX_ANGLE = 1.0 - 1e-5  # cosine between normals
FLOW_PX = 0.01
MAX_POINT_M = 1e-3  # third quartile of a moving object's points


def check_camera(world, sensor, what):
    """Compare a camera's channels by both back ends with own rays.

    Returns:
        Counts of what was compared and of what differs, and a line for each difference.
    """
    model, counts, findings = sensor.model, Counter(), []
    frames = {name: _frame(world, sensor, name) for name in BACKENDS}
    cube, rays = frames["cube"], frames["rays"]

    def differ(kind, mask, where=""):
        number = int(np.count_nonzero(mask))
        counts[kind] += number
        if number:
            findings.append(f"{what}: {number} {kind} {where}")

    differ("pixels of one image alone", cube.valid != rays.valid)
    grid = pixel_grid(model.width_px, model.height_px)
    own = _own_rays(sensor, grid)
    for name, frame in frames.items():
        differ("valid pixels", (frame.channels["valid"] > 0) != own.valid, name)
    valid = own.valid & (cube.channels["valid"] > 0) & (rays.channels["valid"] > 0)
    if not valid.any():
        return counts, findings
    now = world.sensor_pose(0.0) @ sensor.base_from_optical
    directions = own.directions[valid] @ now[:3, :3].T
    origins_m = np.broadcast_to(now[:3, 3], directions.shape)
    if own.origins_m is not None:
        origins_m = origins_m + own.origins_m[valid] @ now[:3, :3].T
    caster = world.own_rays(0.0)
    met = caster.meet(origins_m, directions)
    edge = _edges(valid, met)
    counts["pixels"] += len(edge)
    counts["edges"] += int(edge.sum())
    slant = np.abs(np.einsum("ij,ij->i", met.normals, directions))
    bound_m = POINT_M + met.ranges_m * _ray_rad(sensor) / np.maximum(slant, 1e-3)
    names = np.array([*caster.names, ""])
    flow, flow_bound = _own_flow(world, sensor, own, valid, origins_m, directions, met, caster)
    for name, frame in frames.items():
        values = {channel: frame.channels[channel][valid] for channel in CHANNELS}
        differ("holes", ~np.isfinite(values["range"]), name)
        finite = np.isfinite(values["range"]) & np.isfinite(met.ranges_m)
        error_m = np.abs(np.where(finite, values["range"] - met.ranges_m, np.inf))
        differ("ranges", (error_m > bound_m) & ~edge, name)
        labels = np.array(["", *(label.name for label in frame.labels.instances)])
        differ("instances", (labels[values["instance"]] != names[met.owners]) & ~edge, name)
        cosines = np.einsum("ij,ij->i", values["normals"], met.normals)
        differ("normals", (cosines < MAX_ANGLE) & ~edge & ~_creases(valid, met), name)
        if flow is not None:
            known = np.isfinite(values["flow"]).all(axis=1) & np.isfinite(flow).all(axis=1)
            off_px = np.linalg.norm(np.where(known[:, None], values["flow"] - flow, 0.0), axis=1)
            counts["flows"] += int((known & ~edge).sum())
            differ("flows off", (off_px > flow_bound) & ~edge, name)
    return counts, findings


def _frame(world, sensor, backend):
    with (
        Stage(world.scene, dynamic_objects=world.objects, backend=backend) as stage,
        stage.open(sensor) as camera,
    ):
        states = [
            WorldState({"body": world.sensor_pose(time_s), **world.object_poses(time_s)}, time_s)
            for time_s in (0.0, STEP_S)
        ]
        return camera.render(states[0], also=CHANNELS, next_state=states[1])


def _own_rays(sensor, pixels):
    polygons = sensor.mesh_polygons
    if polygons is not None and isinstance(sensor.model, HyperbolicCamera):
        return mesh_rays(sensor.model, tessellate(sensor.model.mirror, polygons), pixels)
    return sensor.model.ray_from_pixel(pixels)


def _ray_rad(sensor):
    """Bound of a ray's error: a rasterizer snaps the vertices of a mesh to 1/256 px."""
    mirror, polygons = sensor.model, sensor.mesh_polygons
    if polygons is None or not isinstance(mirror, HyperbolicCamera):
        return RAY_RAD
    return RAY_RAD + mirror.domain_limit_rad / mirror.rim_radius_px / 256.0


def _neighbors(image):
    """The image shifted to each of the 8 neighbors."""
    for down, right in itertools.product((-1, 0, 1), repeat=2):
        if down or right:
            yield np.roll(image, (down, right), (0, 1))


def _edges(valid, met):
    """Valid pixels (n,) beside another instance, or on a body beside a part that it may hide."""
    owners, ranges_m = np.full(valid.shape, -2), np.full(valid.shape, np.inf)
    owners[valid], ranges_m[valid] = met.owners, met.ranges_m
    bodies = owners > 0  # 0 is the room
    edge = np.zeros(valid.shape, dtype=bool)
    for near, near_m in zip(_neighbors(owners), _neighbors(ranges_m), strict=True):
        edge |= near != owners
        with np.errstate(invalid="ignore"):
            edge |= ~(np.abs(near_m - ranges_m) < 0.02 * ranges_m) & bodies
    return edge[valid]


def _creases(valid, met):
    """Valid pixels (n,) beside another plane."""
    normals = np.zeros((*valid.shape, 3))
    normals[valid] = met.normals
    crease = np.zeros(valid.shape, dtype=bool)
    for near in _neighbors(normals):
        crease |= np.einsum("hwc,hwc->hw", near, normals) < MAX_ANGLE
    return crease[valid]


def _own_flow(world, sensor, own, valid, origins_m, directions, met, caster):
    """Flow (n, 2) of valid pixels, NaN where nothing is known, and its bound in pixels (n,)."""
    model = sensor.model
    if isinstance(model, NonCentralCamera) or sensor.mesh_polygons is not None:
        return None, None
    finite = np.isfinite(met.ranges_m)
    points_m = origins_m + np.where(finite, met.ranges_m, 1.0)[:, None] * directions
    before, after = world.object_poses(0.0), world.object_poses(STEP_S)
    names = np.array([*caster.names, ""])[met.owners]
    for name in world.objects:
        on_it = np.char.startswith(names, f"{name} ")
        move = after[name] @ np.linalg.inv(before[name])
        points_m[on_it] = points_m[on_it] @ move[:3, :3].T + move[:3, 3]
    there = world.sensor_pose(STEP_S) @ sensor.base_from_optical
    ways = (points_m - there[:3, 3]) @ there[:3, :3]
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    pixels = model.pixel_from_ray(ways)
    flow = pixels.positions_px - pixel_grid(model.width_px, model.height_px)[valid]
    flow[~(pixels.valid & finite)] = np.nan
    period = period_px(model)
    if period is not None:
        flow[:, 0] -= period * np.round(flow[:, 0] / period)
    # what a turn of the ray moves in the image, without bound at a panorama's poles
    bound = np.full(len(flow), FLOW_PX)
    for axis in np.eye(3):
        turned = ways + 10.0 * RAY_RAD * axis
        moved = model.pixel_from_ray(turned / np.linalg.norm(turned, axis=1, keepdims=True))
        step = moved.positions_px - pixels.positions_px
        if period is not None:
            step[:, 0] -= period * np.round(step[:, 0] / period)
        bound += np.where(moved.valid, np.linalg.norm(step, axis=1), np.inf)
    return flow, bound


def check_lidar(world, lidar, what):
    """Compare a lidar's points by both back ends with own rays at each firing's own time."""
    counts, findings = Counter(), []
    expected_m, owners, moving, edge = _own_points(world, lidar)
    counts["beams"] += expected_m.size

    def motion(time_s):
        return WorldState({"body": world.sensor_pose(time_s), **world.object_poses(time_s)}, time_s)

    for name in BACKENDS:
        with (
            Stage(world.scene, dynamic_objects=world.objects, backend=name) as stage,
            stage.open(lidar) as renderer,
        ):
            points = renderer.scan(motion, time_s=lidar.period_s).points
        ranges_m = np.full(expected_m.shape, np.inf)
        firing = np.rint(points["time"] / lidar.period_s * lidar.firings).astype(int)
        ranges_m[points["ring"], firing] = points["range"]
        holes = int(np.isinf(ranges_m).sum())
        error_m = np.abs(ranges_m - expected_m)
        wrong = int(((error_m > 10.0 * MAX_POINT_M) & ~edge).sum())
        counts["holes"] += holes
        counts["beams off"] += wrong
        counts["beams away from edges"] += int((~edge).sum())
        if holes:
            findings.append(f"{what}: {holes} holes {name}")
        if wrong:
            findings.append(f"{what}: {wrong} beams off {name}")
        for number in np.unique(owners[moving]):
            own = error_m[owners == number]
            if len(own) >= 12:
                counts["moving objects"] += 1
                quartile_m = np.percentile(own, 75.0)
                if quartile_m > MAX_POINT_M:
                    counts["moving objects off"] += 1
                    findings.append(
                        f"{what}: moving object off by {1e3 * quartile_m:.1f} mm {name}"
                    )
    return counts, findings


def _own_points(world, lidar):
    """Range, instance, whether it moves, and whether it is an edge, of each beam (rings, firings).

    An edge is beside another instance in the next ring or firing.
    """
    shape = lidar.rings, lidar.firings
    where = np.stack([world.sensor_pose(time_s) for time_s in lidar.times_s])
    directions = np.einsum("fij,rfj->rfi", where[:, :3, :3], lidar.beams.directions)
    origins_m = np.broadcast_to(where[:, :3, 3], directions.shape)

    def meet(parts, object_from_world):
        """Hits of all beams on an object, at each firing where it is then."""
        turned = np.einsum("fij,rfj->rfi", object_from_world[:, :3, :3], directions)
        placed_m = np.einsum("fij,rfj->rfi", object_from_world[:, :3, :3], origins_m)
        placed_m = placed_m + object_from_world[:, :3, 3]
        met = OwnRays(parts).meet(placed_m.reshape(-1, 3), turned.reshape(-1, 3))
        return met.ranges_m.reshape(shape), met.owners.reshape(shape)

    ranges_m, owners = meet(placed(world.scene, np.eye(4)), np.tile(np.eye(4), (shape[1], 1, 1)))
    moving = np.zeros(shape, dtype=bool)
    for number, (name, scene) in enumerate(world.objects.items()):
        poses = np.stack([world.object_poses(time_s)[name] for time_s in lidar.times_s])
        own_m, _ = meet(placed(scene, np.eye(4)), np.linalg.inv(poses))
        nearer = own_m < ranges_m
        ranges_m = np.where(nearer, own_m, ranges_m)
        owners = np.where(nearer, len(world.scene.instances) + number, owners)
        moving |= nearer
    moving &= owners >= len(world.scene.instances)
    edge = np.zeros(shape, dtype=bool)
    padded = np.pad(owners, ((1, 1), (0, 0)), mode="edge")
    leaps = np.pad(ranges_m, ((1, 1), (0, 0)), mode="edge")
    for up, turn in itertools.product((0, 1, 2), (-1, 0, 1)):
        near = np.roll(padded, turn, axis=1)[up : up + shape[0]]
        near_m = np.roll(leaps, turn, axis=1)[up : up + shape[0]]
        edge |= (near != owners) | ((np.abs(near_m - ranges_m) > 0.1 * ranges_m) & (owners > 0))
    return ranges_m, owners, moving, edge
