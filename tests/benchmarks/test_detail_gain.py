"""Simplified towns move no vertex farther than they say."""

import numpy as np
import pytest

from benchmarks.detail_gain import merge_vertices, px_per_rad
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.rendering.opengl.sheets import sheet

CELL_M = 0.6


def test_merged_vertices_stay_within_their_cells():
    mesh = sheet("rough", 0, side=20, size_m=2.0, bumps_m=0.05, seed=1)
    cells_m = np.where(mesh.positions[:, 0] < 0.0, CELL_M, 2.0 * CELL_M)
    merged = merge_vertices(mesh, mesh.positions.astype(float), cells_m)
    moved_m = np.linalg.norm(merged.positions - mesh.positions, axis=1)
    assert np.all(moved_m <= cells_m)
    assert moved_m.max() > 0.1 * CELL_M  # it is a simplification
    corners = merged.positions[merged.triangles]
    sides_m = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert sides_m.min() > 0.0  # triangles whose corners meet are gone
    assert 0 < len(merged.triangles) < len(mesh.triangles)


def test_meshes_within_a_cell_vanish():
    mesh = sheet("small", 0, side=4, size_m=0.01)
    assert merge_vertices(mesh, mesh.positions + 5.01, np.full(len(mesh.positions), 1e3)) is None


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
