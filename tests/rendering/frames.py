"""Frames of scenes by either back end, and batches beside single frames."""

import numpy as np
import pytest

from omnisim import open_sensor

BACKENDS = ("cube", "rays")
each_backend = pytest.mark.parametrize("backend", BACKENDS)


def opened(scene, sensor, backend="cube", **options):
    """An instrument in a scene; the test is skipped where the back end's package is missing."""
    if backend == "rays":
        pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    return open_sensor(scene, sensor, backend=backend, **options)


def frame_of(scene, sensor, state, backend="cube", **options):
    """A frame of a camera in a scene."""
    with opened(scene, sensor, backend) as renderer:
        return renderer.render(state, **options)


def by_both(scene, sensor, state, **options):
    """The same frame by virtual cameras and by rays."""
    return [frame_of(scene, sensor, state, backend, **options) for backend in BACKENDS]


def assert_batch_is_frames(renderer, states, channels=("rgb",), **options):
    """A batch has the bytes of single frames; returns it."""
    batch = renderer.render_batch(states, channels=channels, **options)
    names = tuple(name for name in channels if name not in ("rgb", "rgba"))
    for number, state in enumerate(states):
        frame = renderer.render(state, also=names)
        for name in channels:
            values = getattr(frame, name) if name in ("rgb", "rgba") else frame.channels[name]
            np.testing.assert_array_equal(batch[name][number], values, err_msg=name)
    return batch
