"""A mirror by the parameters of a lens: the same rays as the mirror's own model."""

import numpy as np
import pytest

from omnisim.cameras import (
    HyperbolicCamera,
    MirroredCamera,
    UnifiedCamera,
    camera_from_parameters,
    pixel_grid,
)
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.errors import OpticsError
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap

MIRROR = HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 240, 200)
GAMMA = MIRROR.unified_focal_length_px
LENS = UnifiedCamera(240, 200, (GAMMA, GAMMA), MIRROR.principal_point_px, xi=MIRROR.mirror.xi)


def test_a_mirrored_lens_is_the_mirror():
    mirrored = MirroredCamera(LENS)
    pixels = pixel_grid(240, 200)
    ours, known = mirrored.ray_from_pixel(pixels), MIRROR.ray_from_pixel(pixels)
    np.testing.assert_allclose(
        ours.directions[known.valid], known.directions[known.valid], atol=1e-12
    )
    back = mirrored.pixel_from_ray(ours.directions)
    np.testing.assert_allclose(back.positions_px[ours.valid], pixels[ours.valid], atol=1e-9)
    assert np.array_equal(mirrored.rig_from_optical, MIRROR.rig_from_optical)


def test_a_mirrored_lens_survives_its_parameters():
    mirrored = MirroredCamera(LENS)
    assert camera_from_parameters(mirrored.parameters()) == mirrored
    assert camera_from_parameters({**mirrored.parameters(), "mirrored": False}) == LENS
    assert mirrored.scaled(2.0) == MirroredCamera(LENS.scaled(2.0))


def test_unsuitable_lenses_are_refused():
    with pytest.raises(OpticsError, match="mirrored: expected a lens, got the mirror 'hyperbolic'"):
        MirroredCamera(MIRROR)
    with pytest.raises(OpticsError, match="mirrored: expected true or false, got 'yes'"):
        camera_from_parameters({**LENS.parameters(), "mirrored": "yes"})


def test_gpu_has_the_mirrored_rays(context):
    mirrored = MirroredCamera(LENS)
    rays, valid = PixelMap(context, mirrored).read_rays()
    reference = mirrored.ray_from_pixel(pixel_grid(240, 200))
    both = valid & reference.valid
    assert both.sum() > 0.9 * reference.valid.sum()
    off = np.linalg.norm(rays - reference.directions, axis=-1)  # chords: radians, this small
    assert off[both].max() < 1e-5  # as for all models
