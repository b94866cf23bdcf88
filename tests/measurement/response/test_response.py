"""Response from exposure series: sRGB, powers and a straight line, told apart."""

import numpy as np
import pytest

from omnisim.core.errors import MeasurementError
from omnisim.core.srgb import srgb_from_linear
from omnisim.measurement.response import measure_response
from omnisim.rendering.camera.degradations import Encoding

TIMES_S = (1e-3, 2e-3, 4e-3, 8e-3, 16e-3, 32e-3)


def series(encode, seed=0, noise=0.005, times_s=TIMES_S):
    """8-bit images (60, 80) of a scene of many brightnesses."""
    random = np.random.default_rng(seed)
    scene = np.exp(random.uniform(np.log(0.5), np.log(300.0), (60, 80)))  # light per second
    images = []
    for time_s in times_s:
        light = np.clip(scene * time_s, 0.0, 1.0)
        levels = encode(light) + noise * random.normal(size=light.shape)
        images.append(np.rint(np.clip(levels, 0.0, 1.0) * 255.0).astype(np.uint8))
    return images


def test_a_power_is_found_within_one_percent():
    measured = measure_response(series(Encoding(gamma=1.6).encoded), TIMES_S)
    assert measured.encoding.gamma == pytest.approx(1.6, rel=0.01)
    assert abs(measured.quantities[0].value - 1.6) < 4.0 * measured.quantities[0].sigma


def test_a_straight_line_is_linear():
    measured = measure_response(series(lambda light: light), TIMES_S)
    assert measured.encoding.gamma == 1.0


def test_srgb_is_named_and_its_curve_is_the_camera_s():
    measured = measure_response(series(srgb_from_linear), TIMES_S)
    assert measured.encoding.gamma == "srgb"
    assert measured.errors["srgb"] < 0.01
    seen = (measured.levels > 0.03) & (measured.levels < 0.97)
    light, levels = measured.light[seen], measured.levels[seen]
    # one number, the light of white, is free: a response has no scale
    scale = np.median(srgb_from_linear(light) / levels)
    assert np.abs(srgb_from_linear(light) / scale - levels).max() < 0.01


def filmic(light):
    return np.clip(1.3 * light / (light + 0.3), 0.0, 1.0)


def shoulder(light):
    """Straight, and compressed above a half, as video cameras do."""
    return np.where(light < 0.5, 1.3 * light, 0.65 + 0.7 * (light - 0.5))


@pytest.mark.parametrize("response", [filmic, shoulder])
def test_other_responses_are_solved_for(response):
    measured = measure_response(series(response), TIMES_S)
    assert min(measured.errors[name] for name in ("linear", "srgb", "gamma")) > 0.01
    assert measured.encoding.curve is not None
    light = np.linspace(0.03, 0.97, 95)
    # one number, the light of white, is free: a response has no scale
    at_half = np.interp(0.5, response(light), light) / measured.encoding.linearized(0.5)
    errors = measured.encoding.encoded(light / at_half) - response(light)
    assert np.abs(errors[response(light) < 0.97]).max() < 0.01


@pytest.mark.parametrize(
    ("images", "times_s", "message"),
    [
        (series(srgb_from_linear)[:2], TIMES_S[:2], "2 exposure times: expected at least 3"),
        (series(srgb_from_linear)[::-1], TIMES_S, "2 ms is darker than 1 ms"),
        ([np.full((60, 80), 255, np.uint8)] * 3, TIMES_S[:3], "0 levels between black and white"),
        ([np.zeros((4, w), np.uint8) for w in (4, 5, 4)], TIMES_S[:3], "images of several sizes"),
    ],
)
def test_bad_series_are_refused(images, times_s, message):
    with pytest.raises(MeasurementError, match=message):
        measure_response(images, times_s)
