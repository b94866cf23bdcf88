"""Training of a colour model on labelled pictures, and its rates on others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.perception.landmarks.color_model import (
    BINS,
    NEG,
    ColorModel,
    Costs,
    Roc,
    count_colors,
    roc,
    train,
)

# Every fourth picture validates thresholds Θ; the others fill the histograms.
VALIDATE_EVERY = 4
# Pixels (n, 3) of a picture, sRGB, and their classes (n,): `NEG`, or a landmark colour from 1 on.
LabelledPixels = tuple[NDArray[np.uint8], NDArray[np.uint8]]


@dataclass(frozen=True, eq=False)
class Training:
    """Trained model.

    Attributes:
        model: of the colours.
        curves: ROC of each colour, on pictures that are not in the histograms.
        pictures: how many there were.
    """

    model: ColorModel
    curves: tuple[Roc, ...]
    pictures: int


def train_colors(
    colors: Sequence[str], pictures: Iterable[LabelledPixels], costs: Costs
) -> Training:
    """Train a colour model.

    Raises:
        LocalizationError: a colour that no picture shows.
    """
    train_counts, validation_counts = (np.zeros((1 + len(colors), BINS**3)) for _ in range(2))
    count = 0
    for count, (pixels, classes) in enumerate(pictures, start=1):
        counts = train_counts if count % VALIDATE_EVERY else validation_counts
        counts += count_colors(pixels, classes, 1 + len(colors))
    model, curves = train(colors, train_counts, validation_counts, costs)
    return Training(model, curves, count)


@dataclass(frozen=True, eq=False)
class PixelRates:
    """Classification rates of a model, pixel by pixel.

    Attributes:
        recall: by colour, the share of its pixels that are found.
        false_alarms: by colour, the share of neg's pixels that are taken for it.
        curves: ROC by colour.
    """

    recall: dict[str, float]
    false_alarms: dict[str, float]
    curves: dict[str, Roc]


def pixel_rates(model: ColorModel, pictures: Iterable[LabelledPixels]) -> PixelRates:
    """Rates of a model on pictures of another run."""
    counts = np.zeros((1 + len(model.colors), BINS**3))
    for pixels, classes in pictures:
        counts += count_colors(pixels, classes, len(counts))
    totals = np.maximum(counts.sum(axis=1), 1.0)
    recall, alarms, curves = {}, {}, {}
    for index, name in enumerate(model.colors, start=1):
        passed = model.table == index
        recall[name] = float(counts[index][passed].sum() / totals[index])
        alarms[name] = float(counts[NEG][passed].sum() / totals[NEG])
        curves[name] = roc(model.ratios[index - 1], counts[index], counts[NEG])
    return PixelRates(recall, alarms, curves)
