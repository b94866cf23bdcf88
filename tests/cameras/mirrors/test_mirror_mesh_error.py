import math

import numpy as np
import pytest

import omnisim.cameras.mirrors.mirror_mesh as tessellation
from omnisim.cameras.mirrors import HyperbolicMirror, tessellate
from omnisim.cameras.mirrors.mirror_mesh import (
    Annulus,
    largest_error,
    mesh_error,
    needed_polygons,
)

# Mean, 95 % and maximum in pixels at 360 × 360 of a mesh with rings equally spaced in the image,
# computed by others for the paper's mirror and a rim at 105°.
EQUAL_RINGS = {
    16: (10.4, 19.0, 19.7),
    64: (2.55, 5.05, 5.39),
    256: (0.63, 1.23, 1.43),
    1024: (0.155, 0.302, 0.369),
    4096: (0.039, 0.075, 0.090),
}


@pytest.mark.parametrize("polygons", EQUAL_RINGS)
def test_equal_rings_have_the_known_error_and_ours_a_smaller_one(polygons, monkeypatch):
    mirror = HyperbolicMirror()
    ours = mesh_error(mirror, polygons, 180.0)
    monkeypatch.setattr(tessellation, "RING_EXPONENT", 1.0)
    equal = mesh_error(mirror, polygons, 180.0)
    # 5 %: they sampled pixels, we sample the area evenly
    assert equal == pytest.approx(EQUAL_RINGS[polygons], rel=0.05)
    assert ours.mean_px < 0.96 * equal.mean_px
    assert ours.percentile_95_px < 0.93 * equal.percentile_95_px
    assert ours.max_px < 0.93 * equal.max_px


def test_samples_of_a_triangle_have_its_center_as_mean():
    points, shares = tessellation._lattice(4)
    assert len(points) == 15
    np.testing.assert_allclose(shares @ points, 1.0 / 3.0)


MIRRORS = {
    "paper": HyperbolicMirror(),
    "plane": HyperbolicMirror(k=2.0, theta_max_rad=math.radians(40.0)),
    "nearly plane": HyperbolicMirror(k=2.1, theta_max_rad=math.radians(60.0)),
    "flat": HyperbolicMirror(k=3.0, c=0.5, theta_max_rad=math.radians(120.0)),
    "paraboloid": HyperbolicMirror(k=1e4, theta_max_rad=math.radians(150.0)),
    "to its asymptote": HyperbolicMirror(theta_max_rad=math.radians(155.3)),
    "middle only": HyperbolicMirror(theta_max_rad=math.radians(30.0)),
}
SIZES_PX = (120, 1024)


def _focal_length_px(mirror, size_px):
    return 0.5 * size_px / float(mirror.tangent_from_theta(mirror.theta_max_rad))


@pytest.mark.parametrize("size_px", SIZES_PX)
@pytest.mark.parametrize("mirror", MIRRORS.values(), ids=MIRRORS.keys())
def test_needed_polygons_are_enough_and_few(mirror, size_px):
    focal_length_px = _focal_length_px(mirror, size_px)
    needed = needed_polygons(mirror, 0.1 / focal_length_px)
    error_px = _dense_largest_error_px(mirror, needed, focal_length_px)
    assert error_px < 0.1 * 1.001  # both are samples
    sectors, rings = tessellation.sectors_and_rings(needed)
    assert sectors == 4 * rings
    computed_px = focal_length_px * largest_error(mirror, sectors, rings)
    assert computed_px == pytest.approx(error_px, rel=0.005)
    fewer = 4 * math.isqrt(int(0.7 * needed) // 4) ** 2
    assert _dense_largest_error_px(mirror, fewer, focal_length_px) > 0.1


def _dense_largest_error_px(mirror, polygons, focal_length_px):
    """Largest error by Eq. 1 itself: rays of the pinhole meet the flat triangles of the whole
    mesh's first sector, and what they show is looked for on the mirror."""  # fmt: skip
    mesh = tessellate(mirror, polygons)
    rim = float(mirror.tangent_from_theta(mirror.theta_max_rad))
    azimuths = np.linspace(0.0, 2.0 * math.pi / mesh.sectors, 33)[:-1]
    rings = (np.arange(16 * mesh.rings + 1) / (16 * mesh.rings)) ** tessellation.RING_EXPONENT
    tangents = rim * rings[1:, None, None] * np.stack((np.cos(azimuths), np.sin(azimuths)), -1)
    tangents = tangents.reshape(-1, 2)
    points = _first_hits(mirror, mesh, tangents)
    hit = np.isfinite(points[:, 0])
    off_px = focal_length_px * np.linalg.norm(
        _seen_by_eq1(mirror, points[hit]) - tangents[hit], axis=1
    )
    outline_px = focal_length_px * rim * (1.0 - math.cos(math.pi / mesh.sectors))
    assert np.linalg.norm(tangents[~hit], axis=1).min(initial=rim) > math.cos(
        math.pi / mesh.sectors
    ) * rim * (1.0 - 1e-9)
    return max(off_px.max(), outline_px)


def _first_hits(mirror, mesh, tangents):
    """Points (n, 3), mirror frame, where rays of the pinhole meet the first sector, or NaN."""
    column = np.where(mesh.triangles == 0, 0, (mesh.triangles - 1) % mesh.sectors)
    pinhole = np.array([0.0, 0.0, mirror.c_m])
    rays = np.concatenate((tangents, -np.ones((len(tangents), 1))), axis=1)
    radii = np.linalg.norm(tangents, axis=1)
    points = np.full((len(tangents), 3), np.nan)
    for a, b, c in mesh.vertices_m[mesh.triangles[np.all(column <= 1, axis=1)]]:
        seen = np.array([np.linalg.norm(p[:2]) / (mirror.c_m - p[2]) for p in (a, b, c)])
        near = np.flatnonzero((radii > 0.5 * seen.min()) & (radii < 1.001 * seen.max()))
        # Source: Möller & Trumbore 1997
        ab, ac, start = b - a, c - a, pinhole - a
        across = np.cross(rays[near], ac)
        determinant = across @ ab
        u = across @ start / determinant
        turned = np.cross(start, ab)
        v = rays[near] @ turned / determinant
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9)
        distance = (ac @ turned) / determinant[inside]
        points[near[inside]] = pinhole + distance[:, None] * rays[near[inside]]
    return points


def _seen_by_eq1(mirror, points):
    """Tangents (n, 2) at the pinhole where the mirror shows the directions of points (n, 3).

    Eq. 1 along t times the direction is a quadratic, A t² + B t + C = 0.
    """
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    across = directions[:, 0] ** 2 + directions[:, 1] ** 2
    c, k = mirror.c_m, mirror.k
    quadratic = directions[:, 2] ** 2 - across * (0.5 * k - 1.0)
    linear, constant = -c * directions[:, 2], c * c / (2.0 * k)
    root = np.sqrt(np.maximum(linear**2 - 4.0 * quadratic * constant, 0.0))  # 0 for a plane
    on_mirror = (2.0 * constant / (root - linear))[:, None] * directions
    return on_mirror[:, :2] / (c - on_mirror[:, 2:])


def test_sector_is_that_of_the_mesh():
    mirror = HyperbolicMirror()
    mesh = tessellate(mirror, 256)
    corners = tessellation.sector_triangles_m(mirror, mesh.sectors, mesh.rings)
    column = np.where(mesh.triangles == 0, 0, (mesh.triangles - 1) % mesh.sectors)
    expected = mesh.vertices_m[mesh.triangles[np.all(column <= 1, axis=1)]]
    found = {tuple(np.round(triangle, 12).ravel() + 0.0) for triangle in corners}
    assert found == {tuple(np.round(triangle, 12).ravel() + 0.0) for triangle in expected}


def test_a_part_of_the_image_needs_fewer_polygons():
    mirror = HyperbolicMirror()
    bound = 0.1 / _focal_length_px(mirror, 1024)
    rim = float(mirror.tangent_from_theta(mirror.theta_max_rad))
    whole = needed_polygons(mirror, bound)
    assert needed_polygons(mirror, bound, Annulus(0.0, 0.1 * rim)) < whole
    assert needed_polygons(mirror, bound, Annulus(0.0, 2.0 * rim)) == whole
    assert needed_polygons(mirror, bound, Annulus(2.0 * rim, 3.0 * rim)) == 16


def test_no_mesh_is_fine_enough():
    assert needed_polygons(HyperbolicMirror(), 1e-9) is None
    sectors, rings = tessellation.sectors_and_rings(tessellation.MAX_POLYGONS)
    assert largest_error(HyperbolicMirror(), sectors, rings) > 1e-9
