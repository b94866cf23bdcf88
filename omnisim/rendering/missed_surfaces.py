"""Unusual viewpoints: outside, in objects, or so near to surfaces that a camera misses them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from omnisim.core.arrays import Floats, bounds_of, triangle_bounds
from omnisim.core.short_repr import number_text, point_text
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.quality import scene_size_m
from omnisim.scene import Scene
from omnisim.scene.parts import instance_bounds_m
from omnisim.scene.space.enclosure import enclosing_nodes
from omnisim.scene.space.floor import triangles_within
from omnisim.scene.space.start_pose import DEFAULT_HEIGHT_M, nearest_points

_PROBES = 48  # maximum number of rays per image side
_TRIANGLES_PER_BATCH = 256
_NAMES = 4  # in a note
MIN_FIELD_DEG = 10.0  # narrower fields are noted


def near_plane_note(scene: Scene, sensor: OmniCamera, world_from_base: Floats) -> str | None:
    """Note on surfaces missing before the near plane, of a camera before `seeing`; or None."""
    seeing = sensor.seeing(scene_size_m(scene))
    names = surfaces_too_near(scene, seeing, world_from_base)
    if not names:
        return None
    more = f" and {len(names) - _NAMES} more" if len(names) > _NAMES else ""
    return (
        f"clipped by the near plane, {seeing.near_m:.3g} m: "
        f"{', '.join(names[:_NAMES])}{more} (virtual_cameras.near_m of a sensor file)"
    )


def viewpoint_notes(scene: Scene, sensor: OmniCamera, world_from_base: Floats) -> list[str]:
    """Notes on an unusual viewpoint or field of view, one line each.

    The viewpoint is outside of the scene, inside an object, or nearer to a surface than the near
    plane; the field is narrower than `MIN_FIELD_DEG`. The file's cameras, and the start of a scene
    that is too small to stand in, may be outside.

    Args:
        sensor: camera before it takes the scene's near plane.
        world_from_base: (4, 4) pose of its vehicle.
    """
    point_m, notes = (world_from_base @ sensor.base_from_rig)[:3, 3], list[str]()
    place = f"the viewpoint {point_text(point_m)} m"
    seeing, still = sensor.seeing(scene_size_m(scene)), scene.at_start()
    if not still.instances:
        return notes
    low_m, high_m = still.bounds_m()
    own = [camera.position_m for camera in scene.cameras]
    if (high_m - low_m).max() < DEFAULT_HEIGHT_M:
        own.append(scene.start.position_m)
    is_own = any(np.allclose(place_m, point_m, rtol=0.0, atol=1e-3) for place_m in own)
    beside = (point_m < low_m) | (point_m > np.where([True, True, False], high_m, np.inf))
    near = near_plane_note(scene, sensor, world_from_base)
    if around := _bodies_around(still, point_m):
        notes.append(f"{place} is inside {', '.join(around[:_NAMES])}")
    elif beside.any() and not is_own:
        low, high = (" ".join(number_text(value, 4) for value in end) for end in (low_m, high_m))
        notes.append(f"{place} is outside the scene, which spans {low} to {high} m")
    elif near is None:
        triangles = triangles_within(still, point_m - seeing.near_m, point_m + seeing.near_m)
        _, gaps_m = nearest_points(triangles.corners_m - point_m)
        if len(gaps_m) and gaps_m.min() < 0.99 * seeing.near_m:
            name = still.instances[triangles.instances[np.argmin(gaps_m)]].name
            notes.append(
                f"{place} is {gaps_m.min():.2g} m from {name}, nearer than the near plane, "
                f"{seeing.near_m:.3g} m"
            )
    directions = _probe_rays(sensor)[1]
    if len(directions):
        middle = directions.mean(axis=0)
        cosine = float((directions @ middle).min() / max(np.linalg.norm(middle), 1e-9))
        field_deg = 2.0 * math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
        if field_deg < MIN_FIELD_DEG:
            notes.append(
                f"the camera sees a field of {field_deg:.3g}°: angles named _deg are in degrees"
            )
    return notes if near is None else [*notes, near]


def _bodies_around(scene: Scene, point_m: Floats) -> list[str]:
    """Names of closed objects around a point, but for rooms: those half as wide as the scene."""
    boxes_m = instance_bounds_m(scene.meshes, scene.instances)
    low_m, high_m = scene.bounds_m()
    is_around = np.all((boxes_m[:, 0] < point_m) & (boxes_m[:, 1] > point_m), axis=1)
    is_room = np.all((boxes_m[:, 1] - boxes_m[:, 0])[:, :2] >= 0.5 * (high_m - low_m)[:2], axis=1)
    near = tuple(scene.instances[row] for row in np.flatnonzero(is_around & ~is_room))
    return list(enclosing_nodes(dataclasses.replace(scene, instances=near), point_m))


def surfaces_too_near(scene: Scene, sensor: OmniCamera, world_from_base: Floats) -> tuple[str, ...]:
    """Names of instances with a surface before the camera's near plane.

    Some pixels' rays are cast at near geometry. Moving objects are at their positions at 0 s;
    vehicle bodies and holes in textures are ignored.

    Args:
        sensor: camera with its near plane in the scene.
        world_from_base: (4, 4) pose of its vehicle.
    """
    origins_m, directions = _probe_rays(sensor)
    if not len(directions):
        return ()
    ends_m = sensor.near_m / np.abs(directions).max(axis=1)
    reach_m = float(np.linalg.norm(origins_m, axis=1).max() + ends_m.max())
    rig_from_world = np.linalg.inv(world_from_base @ sensor.base_from_rig)
    still = scene.at_start()
    names: dict[str, None] = {}
    for instance in still.instances:
        mesh = still.meshes[instance.mesh]
        rig_from_mesh = rig_from_world @ instance.world_from_mesh
        places_m = mesh.positions @ rig_from_mesh[:3, :3].T + rig_from_mesh[:3, 3]
        low_m, high_m = bounds_of(places_m)
        if np.any((low_m > reach_m) | (high_m < -reach_m)):
            continue
        corners_m = places_m[mesh.triangles]
        lows_m, highs_m = triangle_bounds(corners_m)
        corners_m = corners_m[np.all((lows_m <= reach_m) & (highs_m >= -reach_m), axis=1)]
        if np.linalg.det(rig_from_mesh[:3, :3]) < 0.0:  # reversed winding
            corners_m = corners_m[:, ::-1]
        both_sides = still.materials[mesh.material].double_sided
        for first in range(0, len(corners_m), _TRIANGLES_PER_BATCH):
            batch_m = corners_m[first : first + _TRIANGLES_PER_BATCH]
            if _is_hit(batch_m, origins_m, directions, ends_m, both_sides):
                names[instance.name] = None
                break
    return tuple(names)


def _probe_rays(sensor: OmniCamera) -> tuple[Floats, Floats]:
    """Origins and unit directions (n, 3) of some pixels' rays, in the rig."""
    model = sensor.model
    u, v = (
        np.linspace(0.0, size - 1.0, min(size, _PROBES))
        for size in (model.width_px, model.height_px)
    )
    rays = model.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    directions = rays.directions[rays.valid]
    origins_m = np.zeros_like(directions) if rays.origins_m is None else rays.origins_m[rays.valid]
    rotation = model.rig_from_optical.T
    return origins_m @ rotation, directions @ rotation


def _is_hit(
    corners_m: Floats, origins_m: Floats, directions: Floats, ends_m: Floats, both_sides: bool
) -> bool:
    """True if any ray (n) hits a triangle (k, 3 corners, xyz) before the end of the ray.

    Source: Möller and Trumbore, "Fast, minimum storage ray-triangle intersection", Journal of
    Graphics Tools 2 (1997).
    """
    a = corners_m[:, 0]
    first, second = corners_m[:, 1] - a, corners_m[:, 2] - a
    # 1, u, v and the range times the determinant, each (n, k)
    determinant = -directions @ np.cross(first, second).T
    from_a = origins_m[:, None] - a
    turned = np.cross(from_a, directions[:, None])
    u = np.einsum("nkc,kc->nk", turned, second)
    v = -np.einsum("nkc,kc->nk", turned, first)
    ranges = np.einsum("nkc,kc->nk", from_a, np.cross(first, second))
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v, ranges = u / determinant, v / determinant, ranges / determinant
        meets = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        meets &= (ranges > 0.0) & (ranges < ends_m[:, None])
    shows = determinant > 0.0 if not both_sides else determinant != 0.0
    return bool(np.any(meets & shows))
