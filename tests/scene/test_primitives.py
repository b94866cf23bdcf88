"""Primitive solids against their volumes, areas and true surfaces."""

import math

import numpy as np
import pytest
import trimesh

from omnisim.scene import primitives

CAPSULE = math.pi * 0.3**2 * 1.4 + 4 / 3 * math.pi * 0.3**3
SOLIDS = {
    "box": (primitives.box((0.5, 1.0, 2.0)), 8.0, (0.5, 1.0, 2.0)),
    "ellipsoid": (primitives.ellipsoid((0.5, 1.0, 2.0)), 4 / 3 * math.pi, (0.5, 1.0, 2.0)),
    "cylinder": (primitives.cylinder(0.3, 0.7), math.pi * 0.3**2 * 1.4, (0.3, 0.3, 0.7)),
    "cone": (primitives.cone(0.3, 0.7), math.pi * 0.3**2 * 1.4 / 3, (0.3, 0.3, 0.7)),
    "capsule": (primitives.capsule(0.3, 0.7), CAPSULE, (0.3, 0.3, 1.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_have_their_volume_and_bounds(name):
    surface, volume, half_sizes = SOLIDS[name]
    solid = trimesh.Trimesh(surface.positions, surface.triangles)  # joins equal corners
    assert solid.is_watertight
    assert solid.volume == pytest.approx(volume, rel=1e-3)  # positive: fronts are outside
    assert solid.bounds[1] == pytest.approx(half_sizes, rel=1e-3)
    assert solid.bounds[0] == pytest.approx(-np.array(half_sizes), rel=1e-3)


@pytest.mark.parametrize("radius_m", [0.005, 0.05, 0.5, 5.0])
def test_spheres_deviate_less_than_they_say(radius_m):
    surface = primitives.ellipsoid((radius_m,) * 3)
    points, _ = trimesh.sample.sample_surface(
        trimesh.Trimesh(surface.positions, surface.triangles), 5000, seed=1
    )
    deviations = np.linalg.norm(points, axis=1) - radius_m
    limit = max(primitives.MAX_DEVIATION * radius_m, primitives.MIN_DEVIATION_M)
    assert np.abs(deviations).max() < 1.01 * limit
    assert abs(deviations.mean()) < 0.5 * limit


def test_normals_point_outside():
    for name in ("ellipsoid", "cylinder", "cone", "capsule"):
        surface = SOLIDS[name][0]
        corners = surface.positions[surface.triangles]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        inside = np.einsum("mi,mi->m", across, surface.normals[surface.triangles[:, 0]])
        assert inside.min() > 0.9, name


def test_a_rectangle_is_seen_from_above():
    surface = primitives.rectangle(1.0, 2.0)
    corners = surface.positions[surface.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (across == (0.0, 0.0, 8.0)).all()
