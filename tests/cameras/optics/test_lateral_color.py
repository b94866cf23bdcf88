"""Lateral color of far points behind a flat port: Snell's law by channel, in closed form."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera
from omnisim.cameras.optics import OpticalSystem, Surface
from omnisim.cameras.optics.centrality import lateral_color_px, seen_rays
from omnisim.cameras.optics.shapes import Plane
from omnisim.cameras.optics.surface import refractive_index
from tests.cameras.optics.examples import SYSTEMS, at, behind_a_dome, port

LENS = EquidistantCamera(200, 200, 80.0, (99.5, 99.5), math.radians(60.0))
INDICES = (1.30, 1.33, 1.36)


@pytest.mark.parametrize(
    "surfaces",
    [port(), (Surface(Plane(), at(0.05), medium=INDICES),)],
    ids=["acrylic and water", "three indices"],
)
def test_flat_port(surfaces):
    """An equidistant lens's radius is f times the angle in air: asin of n sin θ in water."""
    system = OpticalSystem(LENS, surfaces)
    outside = np.linalg.norm(seen_rays(system).directions[:, :2], axis=1)  # sin θ in the water

    def radius_px(color):
        ratio = refractive_index(surfaces[-1].medium, color) / refractive_index("air", color)
        return LENS.focal_length_px * np.arcsin(ratio * outside)

    expected = radius_px("B") - radius_px("R")
    inside = radius_px("B") < LENS.focal_length_px * math.radians(60.0)
    np.testing.assert_allclose(lateral_color_px(system), expected[inside], atol=1e-6)
    assert expected[inside].max() > 0.3


def test_none_where_nothing_is_bent():
    assert len(lateral_color_px(SYSTEMS["sphere"])) == 0
    assert lateral_color_px(behind_a_dome(LENS, 0.1)).max() < 1e-6


def test_chromatic_or_not_it_is_the_same():
    system = OpticalSystem(LENS, (Surface(Plane(), at(0.05), medium=INDICES),))
    chromatic = dataclasses.replace(system, chromatic=True)
    # but for the directions of the pixels: those of green, and of the d line, in air
    np.testing.assert_allclose(lateral_color_px(chromatic), lateral_color_px(system), atol=1e-4)
