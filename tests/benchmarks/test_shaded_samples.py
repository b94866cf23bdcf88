"""Samples that the virtual cameras shade per pixel of the mirror: a count, not a time."""

import numpy as np
import pytest

from benchmarks.pipeline_parts import RepeatedFrame
from benchmarks.settings import at_setting
from benchmarks.suites.limit import JUDGED, SAMPLES
from omnisim import OmniCamera, Stage
from omnisim.scene import load_scene
from tests.scenes import with_warehouse


@pytest.mark.usefixtures("needs_opengl")
@with_warehouse("soccer", "mapping")
def test_little_is_shaded_that_the_image_does_not_show(source):
    with Stage(load_scene(source)) as stage:
        frame = RepeatedFrame.at_start(stage, at_setting(OmniCamera(), JUDGED))
        mirror_px = np.count_nonzero(frame.render()[..., 3])
        samples = frame.count().virtual_cameras.samples / mirror_px
    # fewer than one a pixel would be magnified
    assert 1.0 < samples <= SAMPLES.bound
