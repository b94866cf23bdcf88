"""Vertices and indices that are larger than a binding: the same hits, to the last bit."""

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.world import geometry_store, scene_buffers
from omnisim.rendering.stage import Stage
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from tests.rendering.opengl.sheets import dynamic_object, mixed_scene

CAMERA = OmniCamera().with_quality("fast").resized(100)
CHANNELS = ("range", "instance", "normals", "albedo")
POSES = np.stack([pose((0.2 * n, 0.1, -0.2), yaw_deg=70.0 * n) for n in range(2)])


def _hits():
    """Ground truth of frames and batches, ranges, and the defines of the shader."""
    with Stage(mixed_scene(), dynamic_object()) as stage:
        with stage.open(CAMERA) as renderer:
            frame = renderer.render(POSES[0], also=CHANNELS)
            batch = renderer.render_batch(POSES, channels=CHANNELS)
        with stage.open(LaserScanner()) as laser:
            scans = [laser.scan(one).ranges_m for one in POSES]
            windows = laser._passes._caster._compiled_windows
    return [*(frame.channels[name] for name in CHANNELS), *batch.values(), *scans], windows


@pytest.mark.usefixtures("needs_opengl")
def test_windows_hit_the_same(monkeypatch):
    expected, none = _hits()
    assert none == ()
    size = 1 << 17  # a third of the vertices, half of the indices
    for module in (geometry_store, scene_buffers):
        monkeypatch.setattr(module, "window_bytes", lambda context: size)
    found, windows = _hits()
    assert windows == ("WINDOW_WORD_BITS 15",)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)
