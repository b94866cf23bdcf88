"""Pixels without a light have that of their chart."""

from types import SimpleNamespace

import numpy as np

from omnisim.rendering.baking.baked_files import lightmap

CHARTS = np.array([[0, 0, 0, 1, 1], [0, 0, 0, 1, 1], [-1, -1, 2, 2, 2]], dtype=np.int32)


def _patches(places):
    places = np.array(places)
    return SimpleNamespace(size_px=(5, 3), places=places, atlas_places=places, charts=CHARTS)


def test_light_spreads_to_the_ends_of_its_chart():
    light = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]], np.float32)
    found = lightmap(_patches([0, 9]), light, np.array([True, True]))
    for chart, color in ((0, (1, 0, 0)), (1, (0, 2, 0)), (2, (0, 0, 0)), (-1, (0, 0, 0))):
        assert np.unique(found[chart == CHARTS], axis=0).tolist() == [list(color)]


def test_pixels_are_the_means_of_their_patches_and_neighbors():
    light = np.array([[1.0] * 3, [3.0] * 3, [7.0] * 3], np.float32)
    found = lightmap(_patches([0, 0, 2]), light, np.array([True, True, False]))
    assert (found[CHARTS == 0] == 2.0).all()  # nothing is known at the third
    found = lightmap(_patches([0, 0, 2]), light, np.array([True, True, True]))
    assert found[0].tolist()[:3] == [[2.0] * 3, [4.5] * 3, [7.0] * 3]
