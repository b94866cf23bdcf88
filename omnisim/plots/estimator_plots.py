"""Plots of estimators: trajectories and truth, lost tracking, and errors over varied values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnisim.core.arrays import Floats
from omnisim.plots.style import DPI, GRAY, RED, common_legend, label_axes, show_between

_COLORS = colormaps["tab10"].colors  # type: ignore[attr-defined]  # a list of colors
_LINES = ("-", "--", "-.", ":")  # trajectories often overlap
_MARKS = "osD^vP"
COLUMNS, MAX_PANELS = 3, 12
LOWEST_SHARE = 1e-7  # smallest lower limit of a logarithmic axis, as a share of the largest value
LOG_RATIO = 30.0  # ratio of largest to smallest value above which the axis is logarithmic


@dataclass(frozen=True, eq=False)
class TrackDrawing:
    """Estimated trajectory to draw."""

    positions_m: Floats  # (n, 3) aligned positions
    lost_m: Sequence[Floats]  # true positions (m, 3) in each interval without an estimate
    # (n,) distance traveled, and distance from the truth
    traveled_m: Floats
    offsets_m: Floats


@dataclass(frozen=True, eq=False)
class TrackPanel:
    """Panel with one drive and its estimates."""

    title: str
    truth_m: Floats  # (n, 3) true positions
    tracks: Mapping[str, TrackDrawing]  # estimated trajectories by the name of the estimator
    order: Sequence[str]  # names of all estimators, which determine their colors in all panels


def trajectories_figure(panels: Sequence[TrackPanel]) -> Figure:
    """Trajectories from above, one panel per drive, at most `MAX_PANELS`."""
    panels = panels[:MAX_PANELS]
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    spans_m = [np.ptp(panel.truth_m[:, :2], axis=0) for panel in panels]
    ratio = max(float(high / max(wide, 0.1)) for wide, high in spans_m)
    wide_in = 7.0 if columns == 1 else 3.4
    high_in = wide_in * min(max(ratio, 0.25), 1.3) + 0.9
    size = (wide_in * columns + 2.4, max(rows * high_in, 2.5))
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    for index, panel in enumerate(panels):
        axes = figure.add_subplot(rows, columns, index + 1)
        _draw_panel(axes, panel)
        if len(panels) > 1:
            axes.tick_params(labelsize=7)
    common_legend(figure, loc="outside right upper", fontsize=8)
    return figure


def _draw_panel(axes: Axes, panel: TrackPanel) -> None:
    truth = panel.truth_m
    label_axes(axes, panel.title, "x (m)", "y (m)")
    axes.plot(truth[:, 0], truth[:, 1], color=GRAY, linewidth=5.0, alpha=0.4, label="truth")
    for index, name in enumerate(panel.order):
        track = panel.tracks.get(name)
        if track is None:
            continue
        style, color = _LINES[index % len(_LINES)], _COLORS[index % len(_COLORS)]
        axes.plot(*track.positions_m[:, :2].T, style, color=color, linewidth=1.3, label=name)
        for lost_m in track.lost_m:
            axes.plot(*lost_m[:, :2].T, ":", color=color, linewidth=4.0, alpha=0.7,
                      label=f"{name}: lost here")  # fmt: skip
    axes.plot(*truth[0, :2], "o", color=GRAY, markersize=7.0, label="start")
    margin = 0.08 * max(float(np.ptp(truth[:, :2], axis=0).max()), 0.5)
    low, high = truth[:, :2].min(axis=0), truth[:, :2].max(axis=0)
    show_between(axes, low - margin, high + margin)


def offsets_figure(panel: TrackPanel) -> Figure:
    """Distance from the truth over the distance traveled."""
    figure = Figure(figsize=(9.5, 4.0), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    label_axes(axes, "Distance from the truth", "distance traveled (m)", "distance (m)")
    for index, name in enumerate(panel.order):
        if name in panel.tracks:
            track, color = panel.tracks[name], _COLORS[index % len(_COLORS)]
            positive = np.maximum(track.offsets_m, 1e-6)
            style = _LINES[index % len(_LINES)]
            axes.plot(track.traveled_m, positive, style, color=color, label=name)
    axes.set_yscale("log")
    if panel.tracks:
        figure.legend(loc="outside right upper", fontsize=8)
    return figure


@dataclass(frozen=True)
class LostRow:
    """Intervals without an estimate, in a row of the figure of lost tracking."""

    label: str  # estimator, or value and estimator
    # starts and ends, as shares of the drive's time; None: no trajectory
    lost: Sequence[tuple[float, float]] | None
    reason: str = ""  # reason for the missing trajectory


def lost_figure(rows: Sequence[LostRow]) -> Figure:
    """Lost tracking over the time of the drive, one bar per row."""
    figure = Figure(figsize=(9.5, 1.1 + 0.24 * len(rows)), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    label_axes(axes, "Where tracking was lost (red)", "share of the drive's time (%)", "")
    for index, row in enumerate(rows):
        color = "#dddddd" if row.lost is None else "#bcd3bf"
        axes.broken_barh([(0.0, 100.0)], (index - 0.35, 0.7), color=color)
        spans = [(100.0 * start, 100.0 * (end - start)) for start, end in row.lost or ()]
        axes.broken_barh(spans, (index - 0.35, 0.7), color=RED)
        if row.lost is None:
            axes.text(1.0, index, row.reason, fontsize=7, va="center", color="#444444")
    axes.set_yticks(range(len(rows)), [row.label for row in rows], fontsize=8)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(0.0, 100.0)
    axes.grid(visible=False)
    return figure


@dataclass(frozen=True)
class SweepLine:
    """Measure of an estimator over the values of a variation."""

    name: str  # name of the estimator
    means: Sequence[float]  # mean over the seeds, per value; NaN: no measure
    # half of the confidence interval over the seeds, per value; NaN: unknown
    half_widths: Sequence[float]
    seeds: Sequence[Sequence[float]] = ()  # measures of the single seeds, per value


@dataclass(frozen=True)
class SweepPanel:
    """Measure of all estimators over the values of a variation.

    The axis is numeric if all labels are ascending numbers. Lines have gaps at values without a
    measure.
    """

    title: str  # label of the axis of values
    quantity: str  # label of the measure's axis
    labels: Sequence[str]  # labels of the values, in order
    lines: Sequence[SweepLine]  # one line per estimator, with one mean per value
    missing: str = ""  # legend for values without a measure


def sweep_figure(panel: SweepPanel) -> Figure:
    """Figure with one panel."""
    figure = Figure(figsize=(9.5, 4.5), dpi=DPI, layout="constrained")
    _draw_sweep(figure.add_subplot(), panel)
    figure.legend(loc="outside right upper", fontsize=8)
    return figure


def sweep_grid(rows: Sequence[Sequence[SweepPanel]]) -> Figure:
    """Figure with rows of panels, one column per variation, and one legend."""
    columns = len(rows[0])
    size = 1.6 + 3.4 * columns, 0.5 + 2.6 * len(rows)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    for row, panels in enumerate(rows):
        for column, panel in enumerate(panels):
            axes = figure.add_subplot(len(rows), columns, row * columns + column + 1)
            _draw_sweep(axes, panel)
            axes.xaxis.label.set_fontsize(8)
            axes.yaxis.label.set_fontsize(8)
            axes.tick_params(labelsize=8)
    count = len({label for axes in figure.axes for label in axes.get_legend_handles_labels()[1]})
    common_legend(figure, loc="outside upper center", fontsize=8, ncols=max(1, count))
    return figure


def _draw_sweep(axes: Axes, panel: SweepPanel) -> None:
    labels, lines, missing = panel.labels, panel.lines, panel.missing
    label_axes(axes, "", panel.title, panel.quantity)
    at, is_numeric = np.arange(len(labels), dtype=np.float64), False
    with suppress(ValueError):
        numbers = np.array([float(label) for label in labels])
        is_numeric = bool(np.all(np.diff(numbers) > 0.0))
        at = numbers if is_numeric else at
    step = float(np.diff(at).min()) if len(at) > 1 else 1.0
    shift = 0.25 * step / max(len(lines), 1)  # so that intervals do not overlap
    for index, line in enumerate(lines):
        positions = at + shift * (index - 0.5 * (len(lines) - 1))
        bars = np.nan_to_num(np.asarray(line.half_widths, dtype=np.float64))
        color, mark = _COLORS[index % len(_COLORS)], _MARKS[index % len(_MARKS)]
        axes.errorbar(positions, line.means, bars, fmt=f"{mark}-", color=color, capsize=3.0,
                      linewidth=1.0, markersize=5.0, label=line.name)  # fmt: skip
        for position, values in zip(positions, line.seeds, strict=False):
            if len(values) > 1:
                axes.plot([position] * len(values), values, ".", color=color, markersize=3.0)
        if missing and not np.all(np.isfinite(line.means)):
            gaps = positions[~np.isfinite(line.means)]
            top = np.full(len(gaps), 0.985 - 0.04 * index)
            axes.plot(gaps, top, "x", color=color, markersize=6.0, clip_on=False,
                      transform=axes.get_xaxis_transform())  # fmt: skip
    means = np.concatenate([np.asarray(line.means, dtype=np.float64) for line in lines])
    positive = means[np.isfinite(means) & (means > 0.0)]
    if len(positive) and positive.max() > LOG_RATIO * positive.min():
        axes.set_yscale("log")
        axes.set_ylim(bottom=max(0.5 * positive.min(), LOWEST_SHARE * positive.max()))
    else:
        axes.set_ylim(bottom=0.0)
    is_long = not is_numeric and max(map(len, labels)) > 12
    axes.set_xticks(at, labels, rotation=20 if is_long else 0)
    if missing and not np.all(np.isfinite(means)):
        axes.plot([], [], "x", color=GRAY, label=missing)
