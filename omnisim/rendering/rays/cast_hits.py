"""Ray hits in the form of ground truth, and occlusion of their points from another viewpoint."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, NonCentralCamera, pixels_of_points
from omnisim.ground_truth.hits import HitDetails, Hits
from omnisim.rendering.rays.caster import Rays
from omnisim.rendering.rays.depth_limits import DepthLimits
from omnisim.rendering.rays.embree import NO_TRIANGLE
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.shading.shading import View

# A hit that is nearer than the point by more than this share occludes it, as in occlusion.frag.
_NEARER = 1e-3


class CastHits(NamedTuple):
    """Hits (n,) of rays, as in `Hits`, and the triangles they hit in the geometry."""

    hits: Hits
    triangles: NDArray[np.int32]


class SeenPoints(NamedTuple):
    """Points hit by rays.

    Attributes:
        points_m: (n, 3) viewpoint frame; directions for rays without a hit.
        surfaces_plus_one: (n,) 1 + index into the geometry's surfaces; 0: no hit.
        triangles: (n,) indices into the geometry.
    """

    points_m: NDArray[np.float64]
    surfaces_plus_one: NDArray[np.uint32]
    triangles: NDArray[np.int32]


def cast_hits(
    scene: RayScene,
    rays: Rays,
    footprints: NDArray[np.float32],
    viewpoint_m: NDArray[np.float64],
    objects: ObjectState,
    details: HitDetails,
) -> CastHits:
    """Cast rays (n,) and return hits with points relative to a viewpoint (3,).

    Args:
        scene: scene to cast at.
        rays: (n,) world.
        footprints: (n, 2, 3), see `RayScene.radiance`.
        viewpoint_m: (3,) world.
        objects: state of the dynamic objects.
        details: surface details to compute; the others are empty.
    """
    poses, geometry, shading = objects.world_from_objects, scene.caster.geometry, scene.shading
    first = scene.first_hits(rays, objects, footprints=footprints)
    hit = np.flatnonzero(first.triangles != NO_TRIANGLE)
    some = rays.take(hit)
    exact = scene.caster.exact(some, first.take(hit), poses)
    points = np.empty((len(first.triangles), 4), dtype=np.float32)
    points[:, :3], points[:, 3] = rays.directions, np.inf
    from_viewpoint_m = some.origins_m - viewpoint_m
    points[hit, :3] = from_viewpoint_m + exact.ranges_m[:, None] * some.directions
    points[hit, 3] = exact.ranges_m
    draw_ids, triangles = np.zeros((2, len(points)), dtype=np.uint32)
    surfaces = shading.surfaces(exact)
    draw_ids[hit] = surfaces + 1
    triangles[hit] = exact.triangles - geometry.first_of_surface[surfaces]
    view = View(some, exact, poses, footprints[hit])
    find: dict[str, Callable[[], NDArray[np.float32]]] = {
        "normals": lambda: shading.normals(exact, poses),
        "albedos": lambda: shading.base_colors(*view)[:, :3],
        "materials": lambda: shading.materials(view),
    }
    values = {name: np.empty((0, 0), dtype=np.float32) for name in find}
    for name, numbers in details.components.items():
        values[name] = np.zeros((len(points), numbers), dtype=np.float32)
        values[name][hit] = find[name]()
    return CastHits(Hits(points, draw_ids, triangles, **values), first.triangles)


def moved_points(seen: SeenPoints, other_from_current: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) moved to another viewpoint frame by (surfaces, 3, 4); directions stay."""
    points_m, hit = seen.points_m.copy(), np.flatnonzero(seen.surfaces_plus_one)
    moves = other_from_current[seen.surfaces_plus_one[hit] - 1]
    points_m[hit] = np.einsum("nij,nj->ni", moves[..., :3], points_m[hit]) + moves[..., 3]
    return points_m


def cast_occlusion(
    scene: RayScene,
    limits: DepthLimits,
    moved: SeenPoints,
    starts_m: NDArray[np.float64],
    world_from_rig: NDArray[np.float64],
    objects: ObjectState,
) -> NDArray[np.bool_]:
    """Mask (n,) of points that are occluded along rays from starts (n, 3), viewpoint frame.

    Args:
        scene: scene to cast at.
        limits: depth limits of the rays.
        moved: points at the time and in the frame of the viewpoint.
        starts_m: (n, 3) ray origins.
        world_from_rig: (4, 4) pose of the viewpoint.
        objects: state of the dynamic objects at that time.
    """
    hit, ways_m = np.flatnonzero(moved.surfaces_plus_one), moved.points_m.copy()
    ways_m[hit] -= starts_m[hit]
    ends_m, lengths_m = np.full(len(ways_m), np.inf), np.linalg.norm(ways_m, axis=1)
    ends_m[hit] = (1.0 - _NEARER) * lengths_m[hit]
    rig = np.einsum("nj,ji->ni", ways_m / lengths_m[:, None], world_from_rig[:3, :3])
    rays = limits.aim(rig, world_from_rig)
    rays = rays._replace(origins_m=rays.origins_m + starts_m, far_m=np.minimum(rays.far_m, ends_m))
    hits = scene.first_hits(rays, objects, moved.triangles)
    return hits.triangles != NO_TRIANGLE


def starts_of_rays(
    camera: CentralCamera,
    points_m: NDArray[np.float64],
    is_finite: NDArray[np.bool_],
    world_from_rig: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Origins (n, 3), viewpoint frame, of the camera rays through its points (n, 3)."""
    if not isinstance(camera, NonCentralCamera):
        return np.zeros((1, 3)).repeat(len(points_m), axis=0)
    world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical
    optical_m = np.einsum("nj,ji->ni", points_m, world_from_optical)
    rays = camera.ray_from_pixel(pixels_of_points(camera, optical_m, is_finite).positions_px)
    assert rays.origins_m is not None
    return np.einsum("nj,ij->ni", rays.origins_m, world_from_optical)
