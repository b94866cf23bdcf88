"""Readout from bands of a flickering lamp: the integral of the lamp's light over each row."""

import numpy as np
import pytest

from omnisim.core.errors import MeasurementError
from omnisim.measurement.timing import line_profiles, measure_timing

HEIGHT, WIDTH = 240, 320
FLICKER_HZ = 100.0


def lit_frames(
    readout_s, exposure_s, count=10, modulation=0.4, noise=2.0, columns=False,
    frame_s=0.0337, seed=0, flicker_hz=FLICKER_HZ,
):  # fmt: skip
    """8-bit frames of a structured surface; each row's light is the mean over its exposure."""
    random = np.random.default_rng(seed)
    lines = WIDTH if columns else HEIGHT
    scene = 90.0 + 40.0 * random.random((HEIGHT, WIDTH))
    scene *= np.linspace(0.7, 1.2, HEIGHT)[:, None]
    starts = readout_s * np.arange(lines) / (lines - 1)
    rate = 2.0 * np.pi * flicker_hz
    for number in range(count):
        first = number * frame_s + starts + 0.0013
        bright = np.sin(rate * (first + exposure_s)) - np.sin(rate * first)
        light = 1.0 + modulation * bright / (rate * exposure_s)
        lit = scene * (light if columns else light[:, None])
        yield np.rint(np.clip(lit + noise * random.normal(size=lit.shape), 0, 255)).astype(np.uint8)


def measured(*arguments, lamp=None, **options):
    return measure_timing(line_profiles(lit_frames(*arguments, **options), 255.0), FLICKER_HZ, lamp)


@pytest.mark.parametrize(
    ("readout_s", "columns"), [(0.009, True), (0.0162, False), (0.0301, False), (0.0301, True)]
)
def test_readout_is_found_within_one_percent(readout_s, columns):
    found = measured(readout_s, 0.002, columns=columns)
    assert found.lines == ("columns" if columns else "rows")
    assert found.readout_s == pytest.approx(readout_s, rel=0.01)


def test_standard_deviation_is_honest():
    within = []
    for seed in range(20):
        quantity = measured(0.0162, 0.002, seed=seed).quantities[0]
        within.append(abs(quantity.value - 0.0162) < 2.0 * quantity.sigma)
    assert np.mean(within) >= 0.8  # of 20: 95 % ± 4.9 %, three of them


@pytest.mark.parametrize("exposure_s", [0.002, 0.008])
def test_exposure_follows_from_the_lamp_s_modulation(exposure_s):
    found = measured(0.0301, exposure_s, lamp=0.4)
    (exposure,) = [quantity for quantity in found.quantities if quantity.name == "exposure_s"]
    assert exposure.value == pytest.approx(exposure_s, rel=0.03)
    assert measured(0.0301, exposure_s).unobservable[-1].name == "exposure_s"


def test_a_global_shutter_has_no_readout():
    found = measured(0.0, 0.002)
    assert found.readout_s == 0.0
    assert "without bands" in found.quantities[0].basis


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"modulation": 0.0}, "no bands, and all frames are equally bright"),
        ({"exposure_s": 0.01}, "no bands, and all frames are equally bright"),
        ({"frame_s": 0.03}, "no bands, and all frames are equally bright"),
        ({"count": 3}, "3 frames: expected at least 5"),
        ({"noise": 0.0, "readout_s": 0.004}, "flicker periods per frame"),
    ],
)
def test_what_does_not_tell_is_refused(options, message):
    with pytest.raises(MeasurementError, match=message):
        measured(**{"readout_s": 0.0162, "exposure_s": 0.002, **options})


def test_white_frames_are_refused():
    white = [np.full((20, 30), 255, np.uint8)] * 6
    with pytest.raises(MeasurementError, match="100 % of the pixels are white"):
        line_profiles(white, 255.0)
    sizes = [np.zeros((20, 30), np.uint8), np.zeros((20, 31), np.uint8)]
    with pytest.raises(MeasurementError, match="frames of several sizes"):
        line_profiles(sizes, 255.0)


def test_a_scene_that_moves_is_refused():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    frames = [
        np.where(np.hypot(x - 60 - 20 * index, y - 40 - 15 * index) < 50, 180, 60).astype(np.uint8)
        for index in range(8)
    ]
    with pytest.raises(MeasurementError, match="frames differ by more than bands"):
        measure_timing(line_profiles(frames, 255.0), FLICKER_HZ)
