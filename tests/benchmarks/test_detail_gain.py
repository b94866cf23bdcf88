"""Simplified meshes stay near the whole ones."""

import numpy as np
import pytest
import trimesh

from benchmarks.detail_gain import px_per_rad, simplify
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.rendering.opengl.sheets import sheet

LIMIT_M = 0.02


def test_simplified_meshes_stay_within_their_limit():
    pytest.importorskip("meshoptimizer", reason="needs the extra meshopt")
    mesh = sheet("rough", 0, side=40, size_m=2.0, bumps_m=0.05, seed=1)
    found = simplify(mesh, LIMIT_M)
    assert 0 < len(found.triangles) < 0.7 * len(mesh.triangles)
    corners = mesh.positions[found.triangles].astype(float)
    points = np.repeat(mesh.positions[::7].astype(float), len(corners), axis=0)
    nearest = trimesh.triangles.closest_point(
        np.tile(corners, (len(points) // len(corners), 1, 1)), points
    )
    away_m = np.linalg.norm(nearest - points, axis=1).reshape(-1, len(corners)).min(axis=1)
    assert np.sqrt(np.mean(away_m**2)) <= LIMIT_M  # its error is a mean over planes
    assert simplify(mesh, 10.0) is None


@pytest.mark.parametrize("angle_deg", [95.0, 120.0, 160.0])
def test_densities_are_the_largest_step_of_a_pixel(angle_deg):
    """Differences of the camera's own projection, in all directions around a ray."""
    camera = OmniCamera(polygons=None).resized(360)
    model, step = camera.model, 1e-4
    angle = np.deg2rad(angle_deg)
    ray = np.array([np.sin(angle), 0.0, np.cos(angle)])
    along, across = np.array([np.cos(angle), 0.0, -np.sin(angle)]), np.array([0.0, 1.0, 0.0])
    turns = np.linspace(0.0, np.pi, 91)
    beside = ray + step * (np.cos(turns)[:, None] * along + np.sin(turns)[:, None] * across)
    pixels, valid = model.pixel_from_ray(np.concatenate((ray[None], beside)))
    assert valid.all()
    expected = np.linalg.norm(pixels[1:] - pixels[0], axis=1).max() / step
    density = px_per_rad(camera, (model.rig_from_optical @ ray)[None])[0]
    assert density == pytest.approx(expected, rel=0.02)  # interpolated between quarter pixels
