import dataclasses

import numpy as np
import pytest

from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.mipmaps import masked_mipmaps
from omnisim.scene.model import AlphaMode, Material, Texture
from tests.scenes import scene_of, square


def _fence(size=64, width=3, period=8):
    pixels = np.full((size, size, 4), 255, dtype=np.uint8)
    pixels[..., 3] = np.where(np.arange(size) % period < width, 255, 0)
    return pixels


@pytest.mark.parametrize("width", [1, 3, 5])
def test_coverage_is_kept_as_long_as_a_level_can_show_it(width):
    pixels = _fence(width=width)
    levels = masked_mipmaps(pixels, 0.5)
    assert [level.shape[:2] for level in levels] == [(n, n) for n in (32, 16, 8, 4, 2, 1)]
    for level, step in zip(levels, (1 / 4, 1 / 2), strict=False):
        # the fence's period is four and two texels there: coverage comes in such steps, and is
        # the first that is not too little
        passed = (level[..., 3] >= 127.5).mean()
        assert width / 8 <= passed < width / 8 + step
    levels = masked_mipmaps(_fence(size=37), 0.5)
    assert [level.shape[0] for level in levels] == [18, 9, 4, 2, 1]


def test_a_texel_at_the_cutoff_is_covered():
    for level in masked_mipmaps(np.full((4, 4, 4), 255, dtype=np.uint8), 1.0):
        assert np.all(level[..., 3] == 255)


def test_color_of_holes_does_not_bleed():
    pixels = np.zeros((4, 4, 4), dtype=np.uint8)
    pixels[:, ::2] = (200, 40, 20, 255)
    for level in masked_mipmaps(pixels, 0.5):
        assert np.abs(level[..., :3].astype(int) - (200, 40, 20)).max() <= 1


@pytest.mark.usefixtures("needs_opengl")
def test_far_fence_is_still_there():
    """Seen from so far that a texel is a fraction of a pixel, a third of the fence is drawn."""
    coordinates = np.array([[0, 0], [8, 0], [8, 8], [0, 8]], dtype=np.float32)
    mesh = square(20.0, -6.0, texture_coordinates=coordinates)
    fence = Material(texture=Texture(_fence()), alpha_mode=AlphaMode.MASK)
    plain = dataclasses.replace(fence, alpha_mode=AlphaMode.OPAQUE)
    share = []
    for material in (fence, plain):
        sensor = OmniCamera(polygons=None).resized(120)
        with open_sensor(scene_of([mesh], [material]), sensor) as renderer:
            frame = renderer.render(np.eye(4), linear=True)
        share.append(frame.linear[frame.valid].mean())
    assert 0.2 < share[0] / share[1] < 0.6
