"""A colour model from the pictures of a run and their labels."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import RunError
from omnisim.experiments.run_data import RunData
from omnisim.experiments.run_labels import RunLabels, landmark_colors
from omnisim.perception.color_model import (
    NEG,
    ColorModel,
    Costs,
    Roc,
    count_colors,
    roc,
    train,
)

# Every fourth picture chooses Θ; the others fill the histograms.
JUDGE_EVERY = 4


@dataclass(frozen=True, eq=False)
class Training:
    """What was learned.

    Attributes:
        model: of the colours.
        curves: ROC of each colour, on pictures that are not in the histograms.
        pictures: how many were looked at.
    """

    model: ColorModel
    curves: tuple[Roc, ...]
    pictures: int


def train_on_run(
    run: RunData, costs: Costs, track: Callable[[Iterable[int]], Iterable[int]] = iter
) -> Training:
    """Learn the colours of a run's landmarks.

    Args:
        run: with the channel `instance`.
        costs: of mistakes.
        track: told of each step, for progress.

    Raises:
        RunError: a run without labels, or of too few pictures.
        LocalizationError: a colour that no picture shows.
    """
    colors = landmark_colors(run.landmarks)
    labels = RunLabels(run, colors)
    if run.steps < JUDGE_EVERY:
        raise RunError(
            f"{run.folder.path}: has {run.steps} pictures: want at least {JUDGE_EVERY} to learn "
            "from some and choose Θ by others"
        )
    learn, judge = count_run(run, labels, len(colors), track)
    model, curves = train(colors, learn, judge, costs)
    return Training(model, curves, run.steps)


def count_run(
    run: RunData,
    labels: Callable[[int], NDArray[np.uint8]],
    colors: int,
    track: Callable[[Iterable[int]], Iterable[int]] = iter,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Histograms (1 + colours, 32³) of most pictures of a run, and those of every fourth one."""
    covered = run.mount.covered
    counts: list[NDArray[np.float64] | float] = [0.0, 0.0]
    for step in track(range(run.steps)):
        seen = slice(None) if covered is None else covered
        pixels, classes = run.picture(step)[seen], labels(step)[seen]
        counted = count_colors(pixels.reshape(-1, 3), classes.ravel(), 1 + colors)
        part = int(step % JUDGE_EVERY == JUDGE_EVERY - 1)
        counts[part] = counts[part] + counted
    learn, judge = counts
    assert isinstance(learn, np.ndarray)
    assert isinstance(judge, np.ndarray)
    return learn, judge


@dataclass(frozen=True, eq=False)
class PixelRates:
    """How a model does on a run that it has not seen, pixel by pixel.

    Attributes:
        recall: by colour, the share of its pixels that are found.
        false_alarms: by colour, the share of neg's pixels that are taken for it.
        curves: ROC by colour.
    """

    recall: dict[str, float]
    false_alarms: dict[str, float]
    curves: dict[str, Roc]


def pixel_rates(model: ColorModel, counts: NDArray[np.float64]) -> PixelRates:
    """Rates of a model on the histograms (1 + colours, 32³) of another run."""
    totals = np.maximum(counts.sum(axis=1), 1.0)
    recall, alarms, curves = {}, {}, {}
    for index, name in enumerate(model.colors, start=1):
        passed = model.table == index
        recall[name] = float(counts[index][passed].sum() / totals[index])
        alarms[name] = float(counts[NEG][passed].sum() / totals[NEG])
        curves[name] = roc(model.ratios[index - 1], counts[index], counts[NEG])
    return PixelRates(recall, alarms, curves)
