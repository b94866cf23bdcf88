"""Color histograms: Eq. 3, its thresholds, and models on disk."""

import json

import numpy as np
import pytest

from omnisim.core.errors import LocalizationError, OutputError
from omnisim.perception.landmarks.color_model import (
    BINS,
    ColorModel,
    Costs,
    Roc,
    bin_of,
    choose_threshold,
    count_colors,
    load_model,
    roc,
    save_model,
    train,
)
from omnisim.scene.model import ColorBand, Landmark

POST = Landmark("post", (1.0, 2.0, 0.0), (0.1, 0.1), (ColorBand("red", (1, 0, 0), 0, 1),))
YELLOW, BLUE, GRAY = (240, 210, 8), (8, 180, 240), (120, 120, 120)


def _counts(*classes):
    """Histograms of (pixels, how many) for neg and each color."""
    pixels, labels = [], []
    for label, colors in enumerate(classes):
        for color, count in colors.items():
            pixels += [color] * count
            labels += [label] * count
    return count_colors(np.array(pixels, np.uint8), np.array(labels), len(classes))


def test_bins_are_eight_values_wide():
    pixels = np.array([[0, 0, 0], [7, 7, 7], [8, 0, 0], [0, 0, 8], [255, 255, 255]], np.uint8)
    assert bin_of(pixels).tolist() == [0, 0, 1024, 1, BINS**3 - 1]


def test_a_color_is_told_by_its_likelihood_ratio():
    counts = _counts({GRAY: 900, YELLOW: 100}, {YELLOW: 50, GRAY: 50}, {BLUE: 10})
    model = ColorModel(("yellow", "blue"), counts, (4.9, 4.9), smoothing=1e-9)
    assert model.ratios[0, bin_of(np.array(YELLOW, np.uint8))] == pytest.approx(0.5 / 0.1)
    assert model.ratios[0, bin_of(np.array(GRAY, np.uint8))] == pytest.approx(0.5 / 0.9)
    shown = np.array([[YELLOW, BLUE], [GRAY, (1, 2, 3)]], np.uint8)
    assert model.classify(shown).tolist() == [[1, 2], [0, 0]]
    strict = ColorModel(("yellow", "blue"), counts, (5.1, 4.9), smoothing=1e-9)
    assert strict.classify(shown).tolist() == [[0, 2], [0, 0]]


def test_the_curve_is_that_of_counting():
    generator = np.random.default_rng(0)
    ratios = np.zeros(BINS**3)
    ratios[:200] = generator.uniform(0.0, 5.0, 200)
    hits, alarms = np.zeros(BINS**3), np.zeros(BINS**3)
    hits[:200], alarms[:200] = generator.integers(0, 9, 200), generator.integers(0, 9, 200)
    curve = roc(ratios, hits, alarms)
    for theta in (0.3, 1.0, 4.0):
        at = np.searchsorted(-curve.thresholds, -theta, side="right") - 1
        passed = ratios >= theta
        assert curve.true_positives[at] == pytest.approx(hits[passed].sum() / hits.sum())
        assert curve.false_positives[at] == pytest.approx(alarms[passed].sum() / alarms.sum())
    assert np.all(np.diff(curve.false_positives) >= 0.0)


def test_the_threshold_costs_least():
    """By Bayes, with exactly known histograms: the ratio of costs times that of shares."""
    thresholds = np.geomspace(1e-2, 1e2, 2001)[::-1]
    # an exponential family, whose ratio at x is exp(x): P(pass) by the normal's tails
    from scipy.stats import norm

    x = np.log(thresholds)
    curve = Roc(thresholds, norm.sf(x - 0.5), norm.sf(x + 0.5))
    costs = Costs(missed=1.0, false_alarm=2.0)
    chosen = choose_threshold(curve, 1000.0, 3000.0, costs)
    assert chosen == pytest.approx(2.0 * 3000.0 / 1000.0, rel=0.02)  # the grid's step is 0.5 %


def test_a_color_without_pixels_is_named():
    whole = _counts({GRAY: 9}, {YELLOW: 5}, {BLUE: 1})
    no_yellow, no_blue = (whole * (np.arange(3) != color)[:, None] for color in (1, 2))
    with pytest.raises(LocalizationError, match="color 'blue': has no pixel to learn from"):
        train(("yellow", "blue"), no_blue, no_blue, Costs())
    with pytest.raises(LocalizationError, match="color 'yellow': has no pixel to choose"):
        train(("yellow", "blue"), whole, no_yellow, Costs())


def test_a_model_comes_back_from_its_file(tmp_path):
    counts = _counts({GRAY: 90}, {YELLOW: 5}, {BLUE: 10})
    model = ColorModel(("yellow", "sky_blue"), counts, (3.0, 7.0))
    landmarks = (POST,)
    file = tmp_path / "model.npz"
    save_model(file, model, landmarks)
    again, known = load_model(file)
    assert known == landmarks
    assert (again.colors, again.thresholds) == (model.colors, model.thresholds)
    np.testing.assert_array_equal(again.table, model.table)
    assert [path.name for path in tmp_path.iterdir()] == ["model.npz"]


def test_a_file_that_is_no_model_is_refused(tmp_path):
    with pytest.raises(LocalizationError, match=r"none.npz: cannot be read: No such file"):
        load_model(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("no model")
    with pytest.raises(LocalizationError, match=r"text.npz: is not a color model"):
        load_model(tmp_path / "text.npz")
    np.savez(tmp_path / "other.npz", counts=np.zeros(3))
    with pytest.raises(LocalizationError, match=r"other.npz: is not a color model"):
        load_model(tmp_path / "other.npz")
    model = ColorModel(("yellow",), _counts({GRAY: 9}, {YELLOW: 5}), (3.0,))
    with pytest.raises(OutputError, match=r"expected a name that ends in .npz"):
        save_model(tmp_path / "model.txt", model, ())


def _stored(file, **changed):
    save_model(file, ColorModel(("red",), np.ones((2, BINS**3)), (2.0,)), (POST,))
    with np.load(file) as there:
        values = {**there, **changed}
    np.savez(file, **values)
    return json.loads(str(values["landmarks"]))


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"format": np.inf}, "is not a color model"),
        ({"smoothing": 0.0}, "smoothing = 0: expected a finite number above 0"),
        ({"smoothing": np.nan}, "smoothing = nan: expected"),
        ({"colors": ["red", "red"], "counts": np.ones((3, BINS**3)), "thresholds": [1, 1]},
         "expected different names"),
        ({"landmarks": "{}"}, "landmarks: expected tables, [[landmarks]], got {}"),
        ({"colors": np.array([{}])}, "is not a color model"),  # would have to be unpickled
    ],
)  # fmt: skip
def test_a_model_that_cannot_be_is_refused_in_one_line(tmp_path, changed, reason):
    _stored(tmp_path / "model.npz", **changed)
    with pytest.raises(LocalizationError) as caught:
        load_model(tmp_path / "model.npz")
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "model.npz"))
    assert reason in message
    assert "\n" not in message


@pytest.mark.parametrize("value", [["a", 0, 0], [float("nan"), 0, 0], [0, 0]])
def test_landmarks_of_a_model_are_checked(tmp_path, value):
    landmarks = _stored(tmp_path / "model.npz")
    landmarks[0]["position_m"] = value
    _stored(tmp_path / "model.npz", landmarks=json.dumps(landmarks))
    with pytest.raises(LocalizationError, match=r"landmarks.0.position_m.*train it again"):
        load_model(tmp_path / "model.npz")


def test_a_model_with_flipped_bits_is_refused(tmp_path):
    _stored(tmp_path / "model.npz")
    with np.load(tmp_path / "model.npz") as there:
        np.savez_compressed(tmp_path / "model.npz", **there)
    data = bytearray((tmp_path / "model.npz").read_bytes())
    for at in range(60, len(data) // 2, 3):
        data[at] ^= 0x55
    (tmp_path / "model.npz").write_bytes(data)
    with pytest.raises(LocalizationError, match="is not a color model"):
        load_model(tmp_path / "model.npz")
