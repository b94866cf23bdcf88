"""Baked light against closed forms."""

import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("xatlas")

from omnisim.baking.bake import Bake
from omnisim.baking.settings import BakeSettings
from omnisim.baking.tiles import TileFolder, no_progress
from tests.baking.rooms import box, lit_by, shining


def baked(tmp_path, scene, **settings):
    bake = Bake(scene, BakeSettings(**settings))
    folder = TileFolder(tmp_path / "x.baked", {})
    found = bake.run(folder, 1, no_progress)
    return bake, found, bake.probes(folder, found, 1, no_progress)


@pytest.mark.parametrize("albedo", [0.0, 0.5, 0.8])
def test_furnace(tmp_path, albedo):
    """All walls of a closed room shine alike: E = Le / (1 − a)."""
    room = lit_by(shining(box("room", (2.0, 3.0, 1.5), color=(albedo,) * 3, inwards=True), 0.7))
    _, found, (_, probes) = baked(tmp_path, room, texel_m=0.25, samples=16, bounces=60)
    expected = 0.7 / (1.0 - albedo)
    light = found.gathered[found.is_valid]
    assert len(light) > 100
    # rays aimed at walls and rays by the cosine weigh each other: a mean has little noise
    np.testing.assert_allclose(light.mean(axis=0), expected, rtol=0.02)
    np.testing.assert_allclose(np.median(light, axis=0), expected, rtol=0.03)
    level = probes["sh"][probes["valid"]][:, 0]
    np.testing.assert_allclose(level, expected, rtol=0.03)
