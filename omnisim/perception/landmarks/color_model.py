"""Color model of landmarks: 3-D color histograms and their likelihood ratio.

One histogram per landmark color and one, *neg*, for everything else. A color belongs to a landmark
if it is at least Θ times as likely there as elsewhere:

    P(rgb | landmark color) / P(rgb | neg) ≥ Θ

Source: Schmits & Visser 2008, section 3.2 and Eq. 3. Their bins, Θ and costs are unpublished.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import LocalizationError
from omnisim.core.files.atomic_file import atomic_write, check_suffix
from omnisim.core.files.number_files import read_arrays
from omnisim.core.files.parameters import Number, Parameters, Table, parse_table
from omnisim.scene.model import Landmark

BINS = 32  # along each of red, green and blue
_SHIFT = 3  # 256 values in 32 bins
NEG = 0  # class of everything else; the colors of a model are 1, 2, ...


def bin_of(pixels: Bytes) -> NDArray[np.uint16]:
    """Indices (...) into a flat histogram, of sRGB pixels (..., 3)."""
    binned = pixels.astype(np.uint16) >> _SHIFT
    index = (binned[..., 0] << 10) | (binned[..., 1] << 5) | binned[..., 2]
    return index.astype(np.uint16, copy=False)


def count_colors(pixels: Bytes, labels: NDArray[np.integer[Any]], classes: int) -> Floats:
    """Counts (classes, BINS³) of sRGB pixels (n, 3) of classes (n,), `NEG` or a color from 1."""
    size = BINS**3
    joint = labels.astype(np.int64) * size + bin_of(pixels)
    return np.bincount(joint, minlength=classes * size).reshape(classes, size).astype(np.float64)


def likelihood_ratios(counts: Floats, smoothing: float) -> Floats:
    """Ratios (classes − 1, BINS³) of each landmark color and bin, by Eq. 3.

    Of the counts (classes, BINS³), `NEG` is first. `smoothing` counts are spread evenly over the
    bins of neg: without them, a color never seen elsewhere would pass every Θ. Landmarks are not
    smoothed: a bin without landmark pixels has ratio 0.
    """
    shares = counts[1:] / np.maximum(counts[1:].sum(axis=1, keepdims=True), 1.0)
    spread = smoothing / counts.shape[1]
    neg = (counts[NEG] + spread) / (counts[NEG].sum() + smoothing)
    return shares / neg


@dataclass(frozen=True, eq=False)
class ColorModel:
    """Histograms of landmark colors, with their thresholds.

    Raises:
        LocalizationError: a color or neg without pixels, a repeated color name, or a threshold or
            smoothing that is not above 0.
    """

    # colors, thresholds: names of the landmark colors, and Θ for each
    colors: tuple[str, ...]
    counts: Floats  # (1 + colors, BINS³) numbers of pixels, neg first
    thresholds: tuple[float, ...]
    smoothing: float = 1.0  # see `likelihood_ratios`

    def __post_init__(self) -> None:
        if self.counts.shape != (1 + len(self.colors), BINS**3) or not self.colors:
            raise LocalizationError(
                f"color model: histograms {self.counts.shape}: expected one of {BINS}³ bins for "
                "neg and for each of at least one color"
            )
        if not np.all(np.isfinite(self.counts)) or np.any(self.counts < 0.0):
            raise LocalizationError("color model: histograms: expected finite counts of 0 or more")
        for name, total in zip(("neg", *self.colors), self.counts.sum(axis=1), strict=True):
            if total <= 0.0:
                raise LocalizationError(
                    f"color {name!r}: has no pixel to learn from: expected images that show it"
                )
        if len(self.thresholds) != len(self.colors) or not all(
            0.0 < theta < np.inf for theta in self.thresholds
        ):
            raise LocalizationError(
                f"color model: thresholds {self.thresholds}: expected one above 0 for each color"
            )
        if len(set(self.colors)) < len(self.colors):
            raise LocalizationError(f"color model: colors {self.colors}: expected different names")
        if not 0.0 < self.smoothing < np.inf:
            raise LocalizationError(
                f"color model: smoothing = {self.smoothing:g}: expected a finite number above 0"
            )

    @cached_property
    def ratios(self) -> Floats:
        """Ratios (colors, BINS³) by Eq. 3."""
        return likelihood_ratios(self.counts, self.smoothing)

    @cached_property
    def table(self) -> Bytes:
        """Class of each bin (BINS³,): `NEG`, or 1 + the index of a color.

        If several colors pass their thresholds, the class is that of the color that exceeds its
        threshold by the largest factor.
        """
        excess = self.ratios / np.array(self.thresholds)[:, None]
        best = excess.argmax(axis=0)
        passed = excess[best, np.arange(BINS**3)] >= 1.0
        return np.where(passed, best + 1, NEG).astype(np.uint8)

    def classify(self, pixels: Bytes) -> Bytes:
        """Class (...) of sRGB pixels (..., 3)."""
        return self.table[bin_of(pixels)]

    def color_class(self, name: str) -> int:
        """Class of a color; `NEG`: the model does not have it."""
        return self.colors.index(name) + 1 if name in self.colors else NEG


@dataclass(frozen=True, eq=False)
class Roc:
    """Receiver operating characteristic: both rates at every Θ at which one of them changes."""

    thresholds: Floats  # (n,) descending
    true_positives: Floats  # (n,) share of the landmark's pixels above Θ
    false_positives: Floats  # (n,) share of neg's pixels above Θ

    @property
    def area(self) -> float:
        """Area under the curve, extended by a line to (1, 1): 1 is perfect, 0.5 is guessing."""
        x = np.concatenate(((0.0,), self.false_positives, (1.0,)))
        y = np.concatenate(((0.0,), self.true_positives, (1.0,)))
        return float(np.sum(np.diff(x) * 0.5 * (y[1:] + y[:-1])))


def roc(ratios: Floats, positives: Floats, negatives: Floats) -> Roc:
    """Receiver operating characteristic of one color.

    `ratios` (BINS³,) are those of Eq. 3 from training images; counts (BINS³,) of the color and of
    neg are from other images.
    """
    steps, place = np.unique(ratios, return_inverse=True)
    hits = np.bincount(place, weights=positives, minlength=len(steps))[::-1].cumsum()
    alarms = np.bincount(place, weights=negatives, minlength=len(steps))[::-1].cumsum()
    passes = steps[::-1] > 0.0  # a ratio of 0 never belongs to a landmark
    return Roc(
        steps[::-1][passes],
        hits[passes] / max(positives.sum(), 1.0),
        alarms[passes] / max(negatives.sum(), 1.0),
    )


@dataclass(frozen=True)
class Costs(Parameters, name="costs"):
    """Costs of errors, in any unit: only their ratio matters."""

    missed: Annotated[Number, Field(ge=1e-9, le=1e9)] = 1.0
    """Cost of a false negative: a missed pixel of a landmark."""
    false_alarm: Annotated[Number, Field(ge=1e-9, le=1e9)] = 4.0
    """Cost of a false positive: a detected pixel of anything else."""


def choose_threshold(curve: Roc, positives: float, negatives: float, costs: Costs) -> float:
    """Choose the Θ with minimum cost, for numbers of pixels of the color and of neg.

    All Θ between a threshold of the curve and the next lower one have the same cost; the result is
    the geometric mean of the two.
    """
    total = costs.missed * positives * (1.0 - curve.true_positives)
    total = total + costs.false_alarm * negatives * curve.false_positives
    best = int(total.argmin())
    lower = curve.thresholds[min(best + 1, len(total) - 1)]
    return float(np.sqrt(curve.thresholds[best] * lower))


def train(
    colors: Sequence[str], train_counts: Floats, validation_counts: Floats, costs: Costs
) -> tuple[ColorModel, tuple[Roc, ...]]:
    """Train a model on counts, and choose its thresholds on the counts of other images.

    Counts are (1 + colors, BINS³) numbers of pixels, neg first.

    Raises:
        LocalizationError: a color without pixels to train on, or to choose Θ with.
    """
    untuned = ColorModel(tuple(colors), train_counts, (1.0,) * len(colors))
    curves = []
    for index, name in enumerate(colors):
        if validation_counts[index + 1].sum() <= 0.0:
            raise LocalizationError(
                f"color {name!r}: has no pixel to choose Θ by: expected more images that show it"
            )
        positives = validation_counts[index + 1]
        curves.append(roc(untuned.ratios[index], positives, validation_counts[NEG]))
    negatives = float(validation_counts[NEG].sum())
    thresholds = tuple(
        choose_threshold(curve, float(counts.sum()), negatives, costs)
        for curve, counts in zip(curves, validation_counts[1:], strict=True)
    )
    return ColorModel(tuple(colors), train_counts, thresholds), tuple(curves)


# File of a color model and its landmarks: `.npz`.
#
# It holds `counts` (1 + colors, 32³), `colors`, `thresholds`, `smoothing`, and `landmarks` as JSON,
# so that detection needs no scene; nothing in it is pickled.


FORMAT = 1
MODEL_SUFFIX = ".npz"
_EXPECTED = "expected the .npz file of `omnisim landmarks train`"
_NO_MODEL = (KeyError, TypeError, ValueError, OverflowError, AttributeError, RecursionError)


class _StoredLandmarks(Table):
    landmarks: tuple[Landmark, ...]


def save_model(path: Path, model: ColorModel, landmarks: tuple[Landmark, ...]) -> None:
    """Write a model and its landmarks; atomically.

    Raises:
        OutputError: another suffix, or the file cannot be written.
    """
    check_suffix(path, MODEL_SUFFIX)
    encoded = json.dumps([dataclasses.asdict(landmark) for landmark in landmarks])
    with atomic_write(path) as partial, partial.open("wb") as file:
        np.savez_compressed(
            file, format=FORMAT, counts=model.counts.astype(np.uint32),
            colors=np.array(model.colors), thresholds=np.array(model.thresholds),
            smoothing=model.smoothing, landmarks=encoded,
        )  # fmt: skip


def load_model(path: Path) -> tuple[ColorModel, tuple[Landmark, ...]]:
    """Read a model and its landmarks.

    Raises:
        LocalizationError: the file does not exist, or is not a color model.
    """
    stored = read_arrays(path, LocalizationError, "a color model", _EXPECTED)
    try:
        if int(stored["format"]) != FORMAT:
            raise LocalizationError(
                f"{path}: format = {int(stored['format'])}: expected {FORMAT}: train it again"
            )
        model = ColorModel(
            tuple(str(name) for name in stored["colors"]),
            stored["counts"].astype(np.float64),
            tuple(float(theta) for theta in stored["thresholds"]),
            float(stored["smoothing"]),
        )
        content = {"landmarks": json.loads(str(stored["landmarks"]))}
        try:
            landmarks = parse_table(content, _StoredLandmarks, LocalizationError, "it").landmarks
        except LocalizationError as faults:  # one is enough: such files are not edited by hand
            first = str(faults).partition("\n")[0].removeprefix("it: ")
            raise LocalizationError(f"{first}: train it again") from None
    except _NO_MODEL:
        raise LocalizationError(f"{path}: is not a color model: {_EXPECTED}") from None
    except LocalizationError as reason:
        message = str(reason)
        raise LocalizationError(message if str(path) in message else f"{path}: {message}") from None
    return model, landmarks


# Training of a color model on labeled images, and its rates on other images.


# Every fourth image is for the thresholds Θ; the others fill the histograms.
VALIDATE_EVERY = 4
# Pixels (n, 3) of an image, sRGB, and their classes (n,): `NEG`, or a landmark color from 1.
LabeledPixels = tuple[Bytes, Bytes]


@dataclass(frozen=True, eq=False)
class Training:
    """Color model trained on a number of images.

    Its curves are the receiver operating characteristics of the colors on images that are not in
    the histograms.
    """

    model: ColorModel
    curves: tuple[Roc, ...]
    images: int


def train_colors(colors: Sequence[str], images: Iterable[LabeledPixels], costs: Costs) -> Training:
    """Train a color model.

    Raises:
        LocalizationError: no image shows a color.
    """
    train_counts, validation_counts = (np.zeros((1 + len(colors), BINS**3)) for _ in range(2))
    count = 0
    for count, (pixels, classes) in enumerate(images, start=1):
        counts = train_counts if count % VALIDATE_EVERY else validation_counts
        counts += count_colors(pixels, classes, 1 + len(colors))
    model, curves = train(colors, train_counts, validation_counts, costs)
    return Training(model, curves, count)


@dataclass(frozen=True, eq=False)
class PixelRates:
    """Classification rates of a model per pixel, by color."""

    recall: dict[str, float]  # share of the color's pixels that are recognized
    false_alarms: dict[str, float]  # share of neg's pixels that are taken for the color
    curves: dict[str, Roc]  # receiver operating characteristic


def pixel_rates(model: ColorModel, images: Iterable[LabeledPixels]) -> PixelRates:
    """Classification rates of a model on the images of another run."""
    counts = np.zeros((1 + len(model.colors), BINS**3))
    for pixels, classes in images:
        counts += count_colors(pixels, classes, len(counts))
    totals = np.maximum(counts.sum(axis=1), 1.0)
    recall, alarms, curves = {}, {}, {}
    for index, name in enumerate(model.colors, start=1):
        passed = model.table == index
        recall[name] = float(counts[index][passed].sum() / totals[index])
        alarms[name] = float(counts[NEG][passed].sum() / totals[NEG])
        curves[name] = roc(model.ratios[index - 1], counts[index], counts[NEG])
    return PixelRates(recall, alarms, curves)
