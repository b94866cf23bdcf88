"""Plots of estimated trajectories beside the true one, and of errors against varied values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omnisim.validation.plots.style import DPI, GRAY, label_axes

_COLORS = colormaps["tab10"].colors  # type: ignore[attr-defined]  # a list of colors
_LINES = ("-", "--", "-.", ":")  # many trajectories lie on each other


def trajectories_figure(
    truth: NDArray[np.float64], estimates: Mapping[str, NDArray[np.float64]]
) -> Figure:
    """Trajectories from above.

    Args:
        truth: (n, 3) true positions.
        estimates: (m, 3) aligned positions, by the name of the estimator.
    """
    figure = Figure(figsize=(9.0, 6.5), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    label_axes(axes, "Trajectories from above", "x (m)", "y (m)")
    axes.plot(truth[:, 0], truth[:, 1], color=GRAY, linewidth=5.0, alpha=0.4, label="truth")
    for index, (name, positions) in enumerate(estimates.items()):
        style = _LINES[index % len(_LINES)]
        color = _COLORS[index % len(_COLORS)]
        axes.plot(*positions[:, :2].T, style, color=color, linewidth=1.3, label=name)
    axes.plot(*truth[0, :2], "o", color=GRAY, markersize=7.0, label="start")
    margin = 0.08 * max(float(np.ptp(truth[:, :2], axis=0).max()), 0.5)
    axes.set_xlim(truth[:, 0].min() - margin, truth[:, 0].max() + margin)
    axes.set_ylim(truth[:, 1].min() - margin, truth[:, 1].max() + margin)
    axes.set_aspect("equal")
    figure.legend(loc="outside right upper", fontsize=8)
    return figure


def offsets_figure(
    offsets: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> Figure:
    """Distance from the truth over the distance traveled.

    Args:
        offsets: distances (m,) traveled and from the true positions, by estimator.
    """
    figure = Figure(figsize=(9.0, 4.0), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    label_axes(axes, "Distance from the truth", "distance traveled (m)", "distance (m)")
    for index, (name, (way, distances)) in enumerate(offsets.items()):
        color = _COLORS[index % len(_COLORS)]
        positive = np.maximum(distances, 1e-6)
        axes.plot(way, positive, _LINES[index % len(_LINES)], color=color, label=name)
    axes.set_yscale("log")
    if offsets:
        figure.legend(loc="outside right upper", fontsize=8)
    return figure


@dataclass(frozen=True)
class SweepLine:
    """Errors of an estimator.

    Attributes:
        name: name of the estimator.
        means: absolute trajectory error by value, in percent of the path length; NaN: none.
        spreads: standard deviations over the seeds; NaN: unknown.
    """

    name: str
    means: Sequence[float]
    spreads: Sequence[float]


def sweep_figure(title: str, labels: Sequence[str], lines: Sequence[SweepLine]) -> Figure:
    """Errors over the values; an estimator without a trajectory leaves a gap.

    Args:
        title: the varied quantity.
        labels: values, in order; the first is the robot as it is.
        lines: an estimator each, with as many errors as there are values.
    """
    figure = Figure(figsize=(8.5, 4.5), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    label_axes(axes, title, "", "ATE (% of path length)")
    at = np.arange(len(labels))
    shift = 0.3 / max(len(lines), 1)  # error bars lie beside each other
    for index, line in enumerate(lines):
        offset = shift * (index - 0.5 * (len(lines) - 1))
        bars = np.nan_to_num(np.asarray(line.spreads, dtype=np.float64))
        color = _COLORS[index % len(_COLORS)]
        axes.errorbar(at + offset, line.means, bars, fmt="o-", color=color, capsize=3.0,
                      linewidth=1.0, label=line.name)  # fmt: skip
    means = np.concatenate([np.asarray(line.means, dtype=np.float64) for line in lines])
    positive = means[np.isfinite(means) & (means > 0.0)]
    if len(positive) and positive.max() > 30.0 * positive.min():
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xticks(at, labels)
    figure.legend(loc="outside right upper", fontsize=8)
    return figure
