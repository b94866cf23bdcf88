"""The generated town: as large as asked for, the same every time, of triangles that all differ."""

import numpy as np
import pytest

from benchmarks.errors import BenchmarkError
from benchmarks.town import build_town


def _corners(scene):
    """World corners (n, 3, 3) of all triangles but the outskirts'."""
    return np.concatenate(
        [
            (mesh.positions + instance.world_from_mesh[:3, 3])[mesh.triangles]
            for instance in scene.instances
            for mesh in [scene.meshes[instance.mesh]]
            if instance.name != "outskirts"
        ]
    )


@pytest.mark.parametrize("triangles", [1000, 30_000])
def test_town_has_about_as_many_triangles_as_asked_for(triangles):
    scene = build_town(triangles)
    assert abs(scene.triangle_count - triangles) <= 500  # half of the largest house and its plot
    assert len(scene.instances) == len(scene.meshes)  # nothing is instanced
    corners = np.round(_corners(scene), 3)
    assert len(np.unique(corners.reshape(-1, 9), axis=0)) == len(corners)


def test_towns_are_the_same_every_time_and_around_the_start():
    small, large = _corners(build_town(10_000)), _corners(build_town(60_000))
    np.testing.assert_array_equal(small, _corners(build_town(10_000)))
    near = [
        corners[np.hypot(*(corners[:, 0, :2] - (6.5, 0.0)).T) < 20.0] for corners in (small, large)
    ]
    near = [np.unique(np.round(corners.reshape(-1, 9), 2), axis=0) for corners in near]
    assert len(near[0]) > 1000
    np.testing.assert_allclose(near[0], near[1], atol=0.011)


@pytest.mark.parametrize("triangles", [100, 10**9])
def test_towns_that_cannot_be_are_refused(triangles):
    with pytest.raises(BenchmarkError, match=f"town: expected .* triangles, got {triangles}"):
        build_town(triangles)
