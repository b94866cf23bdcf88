"""Casting rays beside every triangle tried in NumPy, and objects at poses."""

import numpy as np
import pytest

from omnisim.core.errors import OmnisimError
from omnisim.core.poses import pose
from omnisim.scene.model import Instance, Material, Mesh
from tests.scenes import scene_of, square

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.rendering.rays.caster import RayCaster, WorldRays

SIZE = np.array([2.0, 0.5, -1.5])  # the last one mirrors


def rays_from(origins, directions, near_m=0.0, far_m=np.inf):
    """Rays from points (n, 3) or one (3,) along directions (n, 3) of any length."""
    directions = np.asarray(directions, dtype=np.float64)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    count = len(directions)
    origins = np.broadcast_to(np.asarray(origins, dtype=np.float64), (count, 3)).copy()
    return WorldRays(origins, directions, np.full(count, near_m), np.full(count, far_m))


def random_directions(count, seed=3):
    return np.random.default_rng(seed).normal(size=(count, 3))


def soup(count, material=0, seed=1):
    """Triangles here and there."""
    random = np.random.default_rng(seed)
    corners = random.uniform(-4.0, 4.0, (count, 1, 3)) + random.normal(0.0, 0.8, (count, 3, 3))
    triangles = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    return Mesh("soup", corners.reshape(-1, 3).astype(np.float32), triangles, material)


def tried(corners, is_two_sided, rays):
    """Triangle and range along each ray, by trying all of corners (m, 3, 3).

    Source: Möller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    found, ranges = np.full(len(rays.near_m), -1), np.full(len(rays.near_m), np.inf)
    for ray, (origin, direction) in enumerate(zip(rays.origins_m, rays.directions, strict=True)):
        across = np.cross(direction, second)
        determinant = np.einsum("mi,mi->m", first, across)
        away = origin - corners[:, 0]
        u = np.einsum("mi,mi->m", away, across) / determinant
        turned = np.cross(away, first)
        v = turned @ direction / determinant
        along = np.einsum("mi,mi->m", second, turned) / determinant
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (is_two_sided | (determinant > 0))
        hit &= (along >= rays.near_m[ray]) & (along <= rays.far_m[ray])
        if hit.any():
            along = np.where(hit, along, np.inf)
            found[ray], ranges[ray] = along.argmin(), along.min()
    return found, ranges


@pytest.mark.parametrize(
    ("near_m", "far_m", "offset_m"), [(0.0, np.inf, 0.0), (1.0, 3.0, 0.0), (0.0, np.inf, 3e5)]
)
def test_hits_are_those_of_all_triangles(near_m, far_m, offset_m):
    """Also where the instance is mirrored and sheared, and far from the world's origin."""
    shear = np.diag([*SIZE, 1.0])
    shear[0, 1] = 0.7
    shear[:3, 3] = offset_m
    poses = [shear, pose((offset_m, offset_m, offset_m), yaw_deg=30.0)]
    scene = scene_of(
        [soup(60, 0, seed=1), soup(40, 1, seed=2)], [Material(), Material(double_sided=True)], poses
    )
    corners = np.concatenate(
        [
            (mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangles]
            for mesh, matrix in zip(scene.meshes, poses, strict=True)
        ]
    )
    corners[:60] = corners[:60, [0, 2, 1]]  # mirrored
    random = np.random.default_rng(5)
    origins = random.uniform(-2.0, 2.0, (600, 3)) + offset_m
    rays = rays_from(origins, random_directions(600), near_m, far_m)
    caster = RayCaster(scene)
    hits = caster.cast(rays)
    found, ranges_m = tried(corners, np.arange(100) >= 60, rays)
    same = hits.triangles == found
    assert np.mean(same) >= 0.998  # edges, in float32
    hit = np.flatnonzero(same & (found >= 0))
    assert len(hit) > 50
    np.testing.assert_allclose(hits.ranges_m[hit], ranges_m[hit], rtol=1e-4)
    exact = caster.exact(rays.take(hit), hits.take(hit))
    np.testing.assert_allclose(exact.ranges_m, ranges_m[hit], rtol=1e-9)
    points = rays.origins_m[hit] + ranges_m[hit, None] * rays.directions[hit]
    geometry = caster.geometry
    between = np.einsum("nk,nkc->nc", exact.weights, geometry.corners_m(exact.triangles))
    np.testing.assert_allclose(between, points, rtol=1e-7, atol=1e-5)
    assert (np.einsum("nc,nc->n", exact.planes, rays.directions[hit]) < 0.0).all()
    assert (np.einsum("nc,nc->n", hits.planes[hit], rays.directions[hit]) < 0.0).all()


def test_objects_are_hit_where_they_are():
    """Moved by poses alone, in front of the scene and behind it, or hidden."""
    scene = scene_of([square(z_m=0.0)], [Material()])
    ball = scene_of([square(0.5, 0.0), square(0.5, 0.125)], [Material()])
    lower, upper = (Instance(name, i, np.eye(4)) for i, name in enumerate(("lower", "upper")))
    ball = type(ball)(**{**vars(ball), "instances": (lower, upper)})
    caster = RayCaster(scene, [ball])
    rays = rays_from((0.0, 0.0, 2.0), [[0.0, 0.0, -1.0], [1.0, 0.0, -1.0]])
    above = [pose((0.0, 0.0, 1.0), yaw_deg=20.0)]
    hits = caster.cast(rays, above)
    np.testing.assert_allclose(hits.ranges_m, [0.875, 2.0 * np.sqrt(2.0)], rtol=1e-6)
    surfaces = caster.geometry.surface_of_triangle[hits.triangles]
    assert [caster.geometry.surfaces[surface].name for surface in surfaces] == ["upper", "object 0"]
    np.testing.assert_allclose(caster.exact(rays, hits, above).ranges_m[0], 0.875, rtol=1e-12)
    hits = caster.cast(rays, above, frozenset({(0, "upper")}))
    np.testing.assert_allclose(hits.ranges_m[0], 1.0, rtol=1e-6)
    hits = caster.cast(rays, [pose((0.0, 0.0, -1.0))])
    np.testing.assert_allclose(hits.ranges_m[0], 2.0, rtol=1e-6)
    hits = caster.cast(rays, [pose((1.0, 0.0, 1.0), pitch_deg=-45.0)])
    np.testing.assert_allclose(hits.ranges_m[1], np.sqrt(2.0) - 0.125, rtol=1e-6)


def test_a_ray_goes_on_behind_what_it_has_passed():
    layers = [square(z_m=float(height)) for height in range(5)]
    caster = RayCaster(scene_of(layers, [Material(double_sided=True)]))
    rays = rays_from((0.5, 0.2, 4.5), [[0.0, 0.0, -1.0]])
    ranges_m, behind = [], None
    for _ in range(6):
        hits = caster.cast(rays, behind=behind)
        ranges_m.append(float(hits.ranges_m[0]))
        behind = hits.triangles
        rays = rays._replace(near_m=hits.ranges_m)
    np.testing.assert_allclose(ranges_m, [0.5, 1.5, 2.5, 3.5, 4.5, np.inf], rtol=1e-6)


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setattr("omnisim.core.extras.is_installed", lambda module: module != "embreex")
    with pytest.raises(OmnisimError, match=r"needs embreex: pip install 'omnisim-camera\[rays\]'"):
        RayCaster(scene_of([square()])).prepare()
