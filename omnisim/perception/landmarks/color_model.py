"""Color model of landmarks: 3-D color histograms and their likelihood ratio.

One histogram for each landmark color and one, *neg*, for everything else. A color is a
landmark's where it is Θ times as likely there as elsewhere:

    P(rgb | landmark color) / P(rgb | neg) ≥ Θ

Source: Schmits & Visser 2008, section 3.2 and Eq. 3. Their bins, Θ and costs are not published.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import LocalizationError

BINS = 32  # along each of red, green and blue
_SHIFT = 3  # 256 values in 32 bins
NEG = 0  # the class of everything else; a model's colors are 1, 2, ...


def bin_of(pixels: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Index (...) into a flat histogram of sRGB pixels (..., 3)."""
    binned = pixels.astype(np.uint16) >> _SHIFT
    index = (binned[..., 0] << 10) | (binned[..., 1] << 5) | binned[..., 2]
    return index.astype(np.uint16, copy=False)


def count_colors(
    pixels: NDArray[np.uint8], labels: NDArray[np.integer[Any]], classes: int
) -> NDArray[np.float64]:
    """Count colors by class.

    Args:
        pixels: (n, 3) sRGB.
        labels: (n,) class of each: `NEG`, or a landmark color from 1 on.
        classes: how many there are, `NEG` among them.

    Returns:
        (classes, BINS³) counts.
    """
    size = BINS**3
    joint = labels.astype(np.int64) * size + bin_of(pixels)
    return np.bincount(joint, minlength=classes * size).reshape(classes, size).astype(np.float64)


def likelihood_ratios(counts: NDArray[np.float64], smoothing: float) -> NDArray[np.float64]:
    """Eq. 3's ratio of each landmark color and bin (classes − 1, BINS³).

    Args:
        counts: (classes, BINS³), `NEG` first.
        smoothing: counts that are spread over all of neg's bins. Without any, a color that was
            never seen elsewhere would beat every Θ; of landmarks nothing is made up: a bin that
            has none has ratio 0.
    """
    shares = counts[1:] / np.maximum(counts[1:].sum(axis=1, keepdims=True), 1.0)
    spread = smoothing / counts.shape[1]
    neg = (counts[NEG] + spread) / (counts[NEG].sum() + smoothing)
    ratios: NDArray[np.float64] = shares / neg
    return ratios


@dataclass(frozen=True, eq=False)
class ColorModel:
    """Histograms of landmark colors, and the threshold that decides.

    Attributes:
        colors: names of the landmark colors.
        counts: (1 + colors, BINS³) pixels, neg first.
        thresholds: Θ of each color.
        smoothing: see `likelihood_ratios`.

    Raises:
        LocalizationError: no pixel of a color or none of neg, two colors of one name, or a
            threshold or a smoothing that is not above 0.
    """

    colors: tuple[str, ...]
    counts: NDArray[np.float64]
    thresholds: tuple[float, ...]
    smoothing: float = 1.0

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
    def ratios(self) -> NDArray[np.float64]:
        """Eq. 3's ratio (colors, BINS³)."""
        return likelihood_ratios(self.counts, self.smoothing)

    @cached_property
    def table(self) -> NDArray[np.uint8]:
        """Class of each bin (BINS³,): `NEG`, or 1 + the index of a color.

        Where more than one color passes its threshold, the one that passes it by most.
        """
        excess = self.ratios / np.array(self.thresholds)[:, None]
        best = excess.argmax(axis=0)
        passed = excess[best, np.arange(BINS**3)] >= 1.0
        return np.where(passed, best + 1, NEG).astype(np.uint8)

    def classify(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Class (...) of sRGB pixels (..., 3)."""
        return self.table[bin_of(pixels)]

    def color_class(self, name: str) -> int:
        """Class of a color; `NEG`: the model lacks it."""
        return self.colors.index(name) + 1 if name in self.colors else NEG


@dataclass(frozen=True, eq=False)
class Roc:
    """Receiver operating characteristic: both rates at every Θ where one of them changes.

    Attributes:
        thresholds: (n,) descending.
        true_positives: (n,) share of the landmark's pixels that pass.
        false_positives: (n,) share of neg's pixels that pass.
    """

    thresholds: NDArray[np.float64]
    true_positives: NDArray[np.float64]
    false_positives: NDArray[np.float64]

    @property
    def area(self) -> float:
        """Area under the curve, closed by a line to (1, 1): 1 is perfect, 0.5 is guessing."""
        x = np.concatenate(((0.0,), self.false_positives, (1.0,)))
        y = np.concatenate(((0.0,), self.true_positives, (1.0,)))
        return float(np.sum(np.diff(x) * 0.5 * (y[1:] + y[:-1])))


def roc(
    ratios: NDArray[np.float64], positives: NDArray[np.float64], negatives: NDArray[np.float64]
) -> Roc:
    """ROC of one color.

    Args:
        ratios: (BINS³,) Eq. 3's, learned from some images.
        positives, negatives: (BINS³,) counts of the color and of neg, from other images.
    """
    steps, place = np.unique(ratios, return_inverse=True)
    hits = np.bincount(place, weights=positives, minlength=len(steps))[::-1].cumsum()
    alarms = np.bincount(place, weights=negatives, minlength=len(steps))[::-1].cumsum()
    passes = steps[::-1] > 0.0  # a ratio of 0 is never a landmark's
    return Roc(
        steps[::-1][passes],
        hits[passes] / max(positives.sum(), 1.0),
        alarms[passes] / max(negatives.sum(), 1.0),
    )


@dataclass(frozen=True)
class Costs:
    """Costs of mistakes, in any unit: only their ratio counts.

    Attributes:
        missed: one pixel of a landmark that is taken for something else.
        false_alarm: one pixel of something else that is taken for a landmark.
    """

    missed: float = 1.0
    false_alarm: float = 4.0


def choose_threshold(curve: Roc, positives: float, negatives: float, costs: Costs) -> float:
    """Choose the Θ of least cost on images with so many pixels of the color and of neg.

    Between two thresholds that cost the same the one in their middle, on a logarithmic scale.
    """
    total = costs.missed * positives * (1.0 - curve.true_positives)
    total = total + costs.false_alarm * negatives * curve.false_positives
    best = int(total.argmin())
    lower = curve.thresholds[min(best + 1, len(total) - 1)]
    return float(np.sqrt(curve.thresholds[best] * lower))


def train(
    colors: Sequence[str],
    train_counts: NDArray[np.float64],
    validation_counts: NDArray[np.float64],
    costs: Costs,
) -> tuple[ColorModel, tuple[Roc, ...]]:
    """Train a model on counts, and choose its thresholds on counts of other images.

    Args:
        colors: names.
        train_counts, validation_counts: (1 + colors, BINS³), neg first.
        costs: of mistakes.

    Raises:
        LocalizationError: a color without a pixel to learn from, or to choose Θ by.
    """
    untuned = ColorModel(tuple(colors), train_counts, (1.0,) * len(colors))
    curves = []
    for index, name in enumerate(colors):
        if validation_counts[index + 1].sum() <= 0.0:
            raise LocalizationError(
                f"color {name!r}: has no pixel to choose Θ by: expected more images that show it"
            )
        curves.append(
            roc(untuned.ratios[index], validation_counts[index + 1], validation_counts[NEG])
        )
    negatives = float(validation_counts[NEG].sum())
    thresholds = tuple(
        choose_threshold(curve, float(counts.sum()), negatives, costs)
        for curve, counts in zip(curves, validation_counts[1:], strict=True)
    )
    return ColorModel(tuple(colors), train_counts, thresholds), tuple(curves)
