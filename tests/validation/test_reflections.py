"""Images of mirrors, glossy floors, a ball and a pane, by rays and by Mitsuba."""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="Mitsuba, the oracle, is missing")
pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.rendering.rays.shading import ray_optics
from omnisim.validation import reflective_rooms
from omnisim.validation.checks.traced_images import MIN_DB, min_by_cube_db, rendered, traced_paths
from omnisim.validation.image_differences import psnr_db


@pytest.mark.parametrize("name", MIN_DB)
@pytest.mark.usefixtures("needs_opengl")
def test_surfaces_reflect_as_mitsuba_s_paths(name, monkeypatch):
    """At 48 px, with 36 of Mitsuba's paths per pixel, whose noise is the larger.

    Measured by cube: 40.0, 40.4, 36.7 and 42.3 dB; balls by probes: 32.5 and 37.0 dB.
    """
    scene = reflective_rooms.rooms()[name]
    traced = traced_paths(scene, 48, samples=36)
    everywhere = np.ones(traced.shape[:2], dtype=bool)
    assert psnr_db(rendered(scene, 48, 3), traced, everywhere) >= MIN_DB[name]
    assert psnr_db(rendered(scene, 48, 3, "cube"), traced, everywhere) >= min_by_cube_db(name)
    monkeypatch.setattr(ray_optics, "MAX_BOUNCES", 0)  # the sky alone
    without = rendered(scene, 48, 1)
    assert psnr_db(without, traced, everywhere) < MIN_DB[name] - 5.0
