"""Degradations of recorded images: each does what it is called, and more of it at each level."""

import math

import numpy as np
import pytest

from omnisim.perception.localization.filter import Observation
from omnisim.rendering.camera.degradations.defocus import Defocus
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.validation.experiments.experiment_runs import in_field_of_view
from omnisim.validation.experiments.landmark_sections import CAUSES, degraded

SIZE = 96
GEOMETRY = ImageGeometry(SIZE, SIZE, (0.5 * (SIZE - 1), 0.5 * (SIZE - 1)))
BY_NAME = {cause.name: cause for cause in CAUSES}


def _image():
    """Colored sectors and rings in a round mask."""
    v, u = np.mgrid[:SIZE, :SIZE] - 0.5 * (SIZE - 1)
    radius, angle = np.hypot(u, v), np.arctan2(v, u)
    shown = radius < 0.5 * SIZE
    sector = ((angle + math.pi) / (2 * math.pi) * 12).astype(int) % 3
    colors = np.array([(240, 210, 20), (20, 170, 230), (110, 120, 115)], np.uint8)
    image = colors[(sector + (radius // 12).astype(int)) % 3]
    return np.where(shown[..., None], image, 0).astype(np.uint8), shown


@pytest.mark.parametrize("name", list(BY_NAME))
def test_each_level_changes_more_than_the_one_before(name):
    image, shown = _image()
    cause = BY_NAME[name]
    changes = []
    for level in cause.levels:
        changed = degraded(image, 12, shown, GEOMETRY, cause, level)
        assert changed.shape == image.shape
        assert np.all(changed[~shown] == 0)
        changes.append(np.abs(changed[shown].astype(float) - image[shown]).mean())
    assert 0.0 < changes[0] < changes[1] < changes[2]


def test_defocus_is_the_cameras():
    image, shown = _image()
    light = np.concatenate((image / 255.0, shown[..., None]), axis=-1).astype(np.float32)
    quick = BY_NAME["defocus"].apply(light, GEOMETRY, 2.0, 0)
    wanted = Defocus(center_defocus_px=2.0, rim_defocus_px=2.0).apply(light, GEOMETRY)
    inside = shown & (np.hypot(*(np.mgrid[:SIZE, :SIZE] - 0.5 * (SIZE - 1))) < 0.5 * SIZE - 4)
    # float32 through a Fourier transform
    np.testing.assert_allclose(quick[inside], wanted[inside], atol=2e-5)


def test_a_turn_blurs_along_circles_only():
    v, u = np.mgrid[:SIZE, :SIZE] - 0.5 * (SIZE - 1)
    rings = 0.5 + 0.4 * np.sin(np.hypot(u, v) / 5.0)
    light = np.ones((SIZE, SIZE, 4), np.float32)
    light[..., :3] = rings[..., None]
    blurred = BY_NAME["motion blur"].apply(light, GEOMETRY, 8.0, 0)
    inside = np.hypot(u, v) < 0.5 * SIZE - 2
    # what bilinear interpolation takes from a sine of 31 px: (2π/31)²/8 of its 0.4
    np.testing.assert_allclose(blurred[inside], light[inside], atol=0.4 * 0.0055)


def test_ahead_is_within_half_the_field_of_view():
    seen = [
        [Observation(("a",), 1.0, math.radians(turn), 0.1, 0.1) for turn in (-50, -44, 0, 44, 46)]
    ]
    (left,) = in_field_of_view(seen, math.radians(90.0))
    assert [round(math.degrees(each.bearing_rad)) for each in left] == [-44, 0, 44]
