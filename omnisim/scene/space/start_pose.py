"""Default start pose: near the scene's middle, clear of surfaces and not inside an object.

Scenes too small to stand in are treated as objects and seen from outside.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices, triangle_bounds
from omnisim.scene.parts import Instance, Mesh, StartPose, bounds_m, instance_bounds_m

# Default height of the effective viewpoint above the floor: that of a small robot.
DEFAULT_HEIGHT_M = 1.0
# Elevation above an object seen from outside: mirrors show the scene below them.
OUTSIDE_ELEVATION_DEG = 20.0
SCALE_PER_DIAGONAL = 0.1  # for scenes too small for the default height
CLEARANCE_PER_SCALE = 0.25  # 0.25 m in a room
CLEARANCE_PER_HEIGHT = 0.5  # for low scenes, whose default viewpoint is close to the floor
# Heights tried after the default, in units of the scale.
LEVELS = (1.0, 1.5, 0.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0)
FLAT_LEVELS = 2.0  # levels up to this one are tried even in low scenes
NEAR_SCALES = 16.0  # half width of the area that is searched first, around the middle
# Budget of point-triangle comparisons over all heights, and limits on the number of sight tests.
COMPARISONS, MIN_SIGHTS, MAX_SIGHTS = 100_000_000, 64, 1024
HEIGHTS_SHARE = 4  # one height uses at most 1/4 of the sight tests
RING_GROWTH, RING_POINTS = 1.25, 12
GOLDEN_ANGLE_RAD = 2.399963  # offset between rings, so that every direction is covered


def default_start(bounds: Floats) -> StartPose:
    """Pose at the middle of bounds (2, 3), at most 1 m above their floor."""
    low, high = bounds
    x, y = 0.5 * (low[:2] + high[:2])
    z = low[2] + min(DEFAULT_HEIGHT_M, 0.5 * (high[2] - low[2]))
    return StartPose((float(x), float(y), float(z)))


def outside_start(bounds: Floats) -> StartPose:
    """Pose in front of and above bounds (2, 3), one diagonal away from their middle.

    The front is −y, as in glTF and Blender.
    """
    distance = float(np.linalg.norm(bounds[1] - bounds[0]))
    elevation = np.radians(OUTSIDE_ELEVATION_DEG)
    offset = distance * np.array((0.0, -np.cos(elevation), np.sin(elevation)))
    return StartPose(_plain(bounds.mean(axis=0) + offset), 90.0)


def find_start(meshes: tuple[Mesh, ...], instances: tuple[Instance, ...]) -> StartPose:
    """Pose nearest to the middle that is clear of surfaces and not inside an object.

    The result is `default_start` if that pose is free. Otherwise, poses above a floor and at the
    default height are preferred. If no pose is free, as in a closed box seen only from its back
    faces, the result is a clear pose, or the middle. A scene with all sides shorter than
    `DEFAULT_HEIGHT_M` is seen from outside.
    """
    bounds = bounds_m(meshes, instances)
    if 0.0 < (bounds[1] - bounds[0]).max() < DEFAULT_HEIGHT_M:
        return outside_start(bounds)
    middle = np.array(default_start(bounds).position_m)
    scale = min(DEFAULT_HEIGHT_M, SCALE_PER_DIAGONAL * float(np.linalg.norm(bounds[1] - bounds[0])))
    clearance, height = CLEARANCE_PER_SCALE * scale, middle[2] - bounds[0, 2]
    if height > 0.0:
        clearance = min(clearance, CLEARANCE_PER_HEIGHT * height)
    position = middle
    if scale > 0.0:
        near = _Surroundings(meshes, instances, middle, NEAR_SCALES * scale)
        if near.is_clear(middle[None], clearance)[0] and not near.sight(middle)[0]:
            return StartPose(_plain(middle))
        best = _search(near, bounds, middle, scale, clearance)
        is_whole = np.all(bounds[1, :2] - middle[:2] <= near.half_m)
        if not is_whole and (best is None or not best[0]):
            far = _Surroundings(meshes, instances, middle, np.inf)
            best = _search(far, bounds, middle, scale, clearance) or best
        position = middle if best is None else best[1]
    return StartPose(_plain(position))


def _search(
    surroundings: _Surroundings, bounds: Floats, middle: Floats, scale: float, clearance: float
) -> tuple[bool, Floats] | None:
    """Best clear point (3,), if any, after a flag: True if it is not inside an object."""
    radius = min(surroundings.half_m, 0.5 * float(np.linalg.norm(bounds[1, :2] - bounds[0, :2])))
    plan = _rings(middle[:2], 2.0 * clearance, radius, 0.01 * clearance)
    plan = plan[np.all((plan >= bounds[0, :2]) & (plan <= bounds[1, :2]), axis=1)]
    count = COMPARISONS // max(1, len(surroundings.triangles))
    inside, left = None, min(max(count, MIN_SIGHTS), MAX_SIGHTS)
    share = left // HEIGHTS_SHARE
    heights = [middle[2]] if middle[2] > bounds[0, 2] else []
    for level in LEVELS:
        z = bounds[0, 2] + level * scale
        if level <= FLAT_LEVELS or z < bounds[1, 2]:
            heights.append(z)
    for z in heights:
        without_floor = None
        clear = _clear_points(surroundings, plan, z, clearance)
        for point in itertools.islice(clear, min(share, left)):
            (is_inside, has_floor), left = surroundings.sight(point), left - 1
            if not is_inside and has_floor:
                return True, point
            if not is_inside and without_floor is None:
                without_floor = point
            elif is_inside and inside is None:
                inside = point
        if without_floor is not None:
            return True, without_floor
    return None if inside is None else (False, inside)


def _clear_points(
    surroundings: _Surroundings, plan: Floats, z: float, clearance: float
) -> Iterator[Floats]:
    """Clear points (3,) at a height, with growing gaps between the chosen ones."""
    count = wanted = 0
    for first in range(0, len(plan), RING_POINTS):
        batch = plan[first : first + RING_POINTS]
        points = np.column_stack((batch, np.full(len(batch), z)))
        for point in points[surroundings.is_clear(points, clearance)]:
            if count == wanted:
                yield point
                wanted += 1 + count // 16
            count += 1


def _rings(middle: Floats, step: float, radius: float, grid: float) -> Floats:
    """Points (n, 2) on rings around the middle, center first, at multiples of `grid` from it."""
    count = max(0, int(np.log(max(radius / step, 1.0)) / np.log(RING_GROWTH))) + 1
    radii = step * RING_GROWTH ** np.arange(count)
    turns = 2.0 * np.pi * np.arange(RING_POINTS) / RING_POINTS
    angles = turns + GOLDEN_ANGLE_RAD * np.arange(count)[:, None]
    offsets = radii[:, None, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    return middle + np.round(np.concatenate(([[0.0, 0.0]], offsets.reshape(-1, 2))) / grid) * grid


class _Surroundings:
    """Surfaces around a point within a square of the floor plan, of unlimited height."""

    def __init__(
        self,
        meshes: tuple[Mesh, ...],
        instances: tuple[Instance, ...],
        middle: Floats,
        half_m: float,
    ):
        self.half_m = half_m  # half width of the square
        low, high = middle[:2] - half_m, middle[:2] + half_m
        boxes = instance_bounds_m(meshes, instances)
        meets = np.all((boxes[:, 0, :2] <= high) & (boxes[:, 1, :2] >= low), axis=1)
        points, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
        for index in np.flatnonzero(meets):
            mesh, matrix = meshes[instances[index].mesh], instances[index].world_from_mesh
            points.append(mesh.positions @ matrix[:3, :3].T + matrix[:3, 3])
            is_mirrored = np.linalg.det(matrix[:3, :3]) < 0.0  # mirroring flips the winding only
            triangles.append(mesh.triangles[:, :: -1 if is_mirrored else 1] + np.int64(count))
            count += len(mesh.positions)
        self._points, self.triangles = np.concatenate(points), np.concatenate(triangles)
        # stored by axis, so that comparisons read contiguous numbers
        self._low, self._high = np.empty((2, 3, len(self.triangles)))
        for axis in range(3):
            a, b, c = np.ascontiguousarray(self._points[:, axis])[self.triangles.T]
            self._low[axis] = np.minimum(np.minimum(a, b), c)
            self._high[axis] = np.maximum(np.maximum(a, b), c)

    def _within(self, low: Floats, high: Floats) -> Floats:
        """Corners (n, 3, 3) of the triangles whose bounds overlap a box with two corners (3,)."""
        near: Indices | slice = slice(None)
        rows = np.arange(len(self.triangles))
        for axis in (2, 0, 1):
            if np.isfinite(low[axis]):
                meets = self._low[axis, near] <= high[axis]
                meets &= self._high[axis, near] >= low[axis]
                near = rows = rows[meets]
        return self._points[self.triangles[near]]

    def is_clear(self, points: Floats, clearance: float) -> Bools:
        """Mask (n,) of the points (n, 3) without a surface within the clearance."""
        clear = np.ones(len(points), dtype=bool)
        if not len(points):
            return clear
        corners = self._within(points.min(axis=0) - clearance, points.max(axis=0) + clearance)
        if not len(corners):
            return clear
        low, high = triangle_bounds(corners)
        near = [
            np.flatnonzero(np.all((low <= point + clearance) & (high >= point - clearance), axis=1))
            for point in points
        ]
        rows = np.repeat(np.arange(len(points)), [len(ones) for ones in near])
        _, distances = nearest_points(corners[np.concatenate(near)] - points[rows, None])
        clear[rows[distances < clearance]] = False
        return clear

    def sight(self, point: Floats) -> tuple[bool, bool]:
        """Look along the axes: is a point (3,) inside an object, and is a floor below it?

        It is inside if most hits are back faces.
        """
        hits = backs = 0
        has_floor = False
        for axis in range(3):
            ends = np.where(np.arange(3) == axis, np.inf, 0.0)
            corners = self._within(point - ends, point + ends)
            if not len(corners):
                continue
            offsets, fronts = _crossings(corners - point, axis)
            for direction in (1.0, -1.0):
                ahead = np.flatnonzero(offsets * direction > 0.0)
                if not len(ahead):
                    continue
                nearest = ahead[np.argmin(offsets[ahead] * direction)]
                hits += 1
                backs += int(fronts[nearest] * direction > 0.0)
                has_floor |= axis == 2 and direction < 0.0
        return 2 * backs > hits, has_floor


def _crossings(corners: Floats, axis: int) -> tuple[Floats, Floats]:
    """Offsets (n,) at which an axis through the origin crosses triangles (m, 3, 3), and the signs
    (n,) of their normals' components along it."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    following = corners[:, [1, 2, 0]]
    # twice the areas spanned with each edge: barycentric coordinates of the opposite corner
    areas = corners[..., u] * following[..., v] - corners[..., v] * following[..., u]
    total = areas.sum(axis=1)
    crossed = (np.all(areas >= 0.0, axis=1) | np.all(areas <= 0.0, axis=1)) & (total != 0.0)
    shares = areas[crossed] / total[crossed, None]
    along = corners[crossed][:, [2, 0, 1], axis]
    return np.einsum("nk,nk->n", shares, along), np.sign(total[crossed])


def nearest_points(corners: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) of triangles (n, 3, 3) nearest to the origin, and their distances (n,)."""
    edges = corners[:, [1, 2, 0]] - corners
    squares = np.maximum(np.einsum("nij,nij->ni", edges, edges), np.finfo(np.float64).tiny)
    shares = np.clip(-np.einsum("nij,nij->ni", corners, edges) / squares, 0.0, 1.0)
    on_edges = corners + shares[..., None] * edges
    lengths = np.linalg.norm(on_edges, axis=2)
    nearest = np.take_along_axis(on_edges, lengths.argmin(axis=1)[:, None, None], axis=1)[:, 0]
    normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, areas, out=np.zeros_like(normals), where=areas > 0.0)
    heights = np.einsum("ni,ni->n", corners[:, 0], normals)
    feet = heights[:, None] * normals
    sides = np.einsum("nij,nj->ni", np.cross(edges, feet[:, None] - corners), normals)
    above = np.all(sides >= 0.0, axis=1) & (areas[:, 0] > 0.0)
    points = np.where(above[:, None], feet, nearest)
    return points, np.where(above, np.abs(heights), lengths.min(axis=1))


def _plain(point: Floats) -> tuple[float, float, float]:
    x, y, z = map(float, point)
    return x, y, z
