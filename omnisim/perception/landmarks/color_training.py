"""Training of a color model on labeled images, and its rates on other images."""

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

# Every fourth image is for the thresholds Θ; the others fill the histograms.
VALIDATE_EVERY = 4
# Pixels (n, 3) of an image, sRGB, and their classes (n,): `NEG`, or a landmark color from 1.
LabeledPixels = tuple[NDArray[np.uint8], NDArray[np.uint8]]


@dataclass(frozen=True, eq=False)
class Training:
    """Trained model.

    Attributes:
        model: color model.
        curves: receiver operating characteristic of each color, on images that are not in the
            histograms.
        images: number of images.
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
    """Classification rates of a model per pixel.

    Attributes:
        recall: by color, share of the color's pixels that are recognized.
        false_alarms: by color, share of neg's pixels that are taken for the color.
        curves: receiver operating characteristic, by color.
    """

    recall: dict[str, float]
    false_alarms: dict[str, float]
    curves: dict[str, Roc]


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
