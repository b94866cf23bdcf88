"""Pixels that instances would cover alone, against closed forms."""

import numpy as np
import pytest

from omnisim import Scene
from omnisim.cameras import PerspectiveCamera

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.rendering.pixel_rays import PixelRays
from omnisim.rendering.rays.caster import DepthLimits
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.scene_rays import whole_areas_px

CAMERA = PerspectiveCamera(100, 80, 52.0, (49.5, 39.5))


def _plate(name, x_m, right_m, left_m):
    """Plate across the optical axis, 2 m high: its edges are between pixels."""
    corners = [(x_m, y, z) for y, z in ((right_m, -1), (left_m, -1), (left_m, 1), (right_m, 1))]
    return Scene.from_arrays(name, corners, [(0, 1, 2), (0, 2, 3)])


def test_hidden_pixels_count_but_those_out_of_the_image_do_not():
    scene = _plate("behind", 4.0, -1.0, 1.0)
    scene = scene.added("before", _plate("before", 2.0, 0.0, 1.0))
    scene = scene.added("beside", _plate("beside", 4.0, 3.0, 5.0))
    rays = RayScene(scene)
    names = [one.name for one in rays.caster.geometry.surfaces]
    ids = {"behind": 1, "before": 2, "beside": 3}
    found = whole_areas_px(
        rays,
        PixelRays(CAMERA, None),
        DepthLimits(0.05, np.inf),
        np.eye(4),
        ObjectState(),
        np.array([ids[name] for name in names]),
        np.zeros((80, 100), dtype=np.uint32),
    )
    # 52 px × 1 m/4 m to either side; beside, from 39 px on, of which 50 px are in the image
    assert found.tolist() == [0, 26 * 26, 26 * 52, 11 * 26]
