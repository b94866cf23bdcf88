"""Stored light keeps to a share of the largest number, in fewer digits."""

import zlib

import numpy as np

from omnisim.rendering.baking.baked_files import rounded_halves


def test_error_is_at_most_a_256th_of_the_brightest_channel():
    random = np.random.default_rng(3)
    light = 10.0 ** random.uniform(-2.5, 3.0, (4000, 1)) * random.random((4000, 3))
    off = np.abs(rounded_halves(light, -1).astype(np.float64) - light)
    assert (off.max(axis=1) <= light.max(axis=1) / 256.0).all()


def test_signs_zeros_and_the_largest_half_stay():
    light = np.array([[-3.0, 0.0, 1.5], [0.0, 0.0, 0.0], [1e6, 65504.0, 0.0]])
    found = rounded_halves(light, -1)
    assert found.tolist() == [[-3.0, 0.0, 1.5], [0.0, 0.0, 0.0], [65504.0, 65504.0, 0.0]]


def test_smooth_light_is_stored_in_fewer_bytes():
    light = np.linspace(0.5, 1.5, 60_000).reshape(-1, 3)
    rounded, plain = rounded_halves(light, -1), light.astype(np.float16)
    assert len(zlib.compress(rounded.tobytes())) < 0.7 * len(zlib.compress(plain.tobytes()))
