"""Atlases of lidars, in parts where one would be too large."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.rendering.opengl.hits import lidar_beams
from omnisim.rendering.stage import open_sensor
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
from tests.scenes import ROOM_HALF_M, room, scene_of

LIMIT_PX = 16384
DENSE = {
    "two rings far below": (-72.97, -72.8),
    "twenty rings within a degree": np.linspace(-73.0, -72.0, 20),
    "128 rings from below to above": np.linspace(-80.0, 10.0, 128),
    "128 rings within a tenth of a degree": np.linspace(-80.0, -79.9, 128),
    "128 rings, denser in the middle": np.unique(
        np.concatenate((np.linspace(-25.0, 15.0, 81), np.linspace(-6.0, 2.0, 65)))
    )[:128],
}


def _lidar(elevations_deg, firings=1800):
    return SpinningLidar(elevations_deg=tuple(map(float, elevations_deg)), firings=firings)


@pytest.mark.parametrize("name", DENSE)
@pytest.mark.parametrize("firings", [8, 16384])
def test_atlases_of_dense_rings_fit(name, firings):
    beams = _lidar(DENSE[name], firings).beams
    for slices in (1, 64):
        in_slice = -(-firings // slices)
        count, plan = lidar_beams._plan_part(beams, in_slice, slices == 1, LIMIT_PX)
        assert 0 < count <= in_slice
        assert max(plan.width_px, plan.height_px) <= LIMIT_PX
        assert plan.width_px * plan.height_px <= lidar_beams.MAX_TEXELS


@pytest.mark.parametrize("lidar", [SpinningLidar.vlp16(), SpinningLidar.hdl64e()])
def test_usual_lidars_need_one_atlas(lidar):
    count, _ = lidar_beams._plan_part(lidar.beams, lidar.firings, True, LIMIT_PX)
    assert count == lidar.firings


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("is_moving", [False, True])
def test_parts_hit_what_the_whole_hits(is_moving, monkeypatch):
    """A room's walls, by parts of each slice and by all of it at once."""
    elevations_deg = np.linspace(-65.0, 50.0, 24)
    lidar = dataclasses.replace(_lidar(elevations_deg, 100).without_errors(), range_min_m=0.0)

    def motion(time_s):
        return pose((0.4 + time_s * is_moving, -0.3, -0.2), yaw_deg=20.0)

    clouds = []
    for texels in (lidar_beams.MAX_TEXELS, 1 << 15):
        monkeypatch.setattr(lidar_beams, "MAX_TEXELS", texels)
        with open_sensor(scene_of([room()]), lidar) as renderer:
            clouds.append(renderer.scan(motion))
    assert lidar_beams._plan_part(lidar.beams, 13, False, LIMIT_PX)[0] < 13
    whole, parts = (cloud.points for cloud in clouds)
    assert len(whole) == len(parts) == 24 * 100
    np.testing.assert_array_equal(parts["range"], whole["range"])
    assert whole["range"].max() > ROOM_HALF_M[0]
