"""Numbers of triangles behind a frame: submitted, drawn and seen."""

import numpy as np
import pytest

from omnisim import OmniCamera, Stage
from tests.scenes import scene_of, square
from tests.vehicles import body

CAMERA = OmniCamera(polygons=None).with_quality("fast").resized(90)
POSE = CAMERA.base_pose((0.0, 0.0, 0.0))
# a floor, a square below it, and one that is too far up for the mirror
SCENE = scene_of([square(50.0, -1.0), square(0.5, -2.0), square(0.5, 30.0)])


@pytest.mark.usefixtures("needs_opengl")
def test_hidden_triangles_are_submitted_and_not_seen():
    with Stage(SCENE) as stage, stage.open(CAMERA) as renderer:
        before = renderer.render(POSE).rgba
        counted = renderer.statistics(POSE)
        assert counted.submitted == 6
        assert counted.seen == 2
        assert 2 <= counted.drawn <= 6 * len(renderer._passes.cube.plan.tiles)
        assert renderer.statistics(POSE) == counted
        assert np.array_equal(renderer.render(POSE).rgba, before)


@pytest.mark.usefixtures("needs_opengl")
def test_parts_that_the_camera_does_not_see_are_not_submitted():
    with Stage(SCENE, body()) as stage:
        counts = []
        for hidden in ((), ("box",)):
            with stage.open(CAMERA, hidden=hidden) as renderer:
                counts.append(renderer.statistics(POSE).submitted)
        assert counts == [6 + body().triangle_count, 6 + body().triangle_count - 12]


def test_rays_draw_nothing():
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    with Stage(SCENE, backend="rays") as stage, stage.open(CAMERA) as renderer:
        assert renderer.statistics(POSE) == (6, 0, 2)
