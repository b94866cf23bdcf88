"""Detected landmarks and self-localization: boxes, rates, paths with covariance ellipses, errors.

After the paper's figures 11 to 13.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Rectangle

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.srgb import srgb_from_linear
from omnisim.perception.landmarks.color_model import Roc
from omnisim.perception.landmarks.landmark_detector import Detection
from omnisim.perception.localization.track import Interval, Track
from omnisim.plots.style import BLUE, DPI, GRAY, GREEN, ORANGE, RED, common_legend, label_axes
from omnisim.scene.model import Landmark

_BOX = "#111111"
SIGMAS = 3.0
MIN_M = 1e-3  # lower end of the errors' scale: a known start has no error
_GRASS, _INK = "#e9f2e6", "#222222"


def detections_figure(
    rows: Sequence[tuple[str, Bytes, Sequence[Detection]]], width_in: float = 13.0
) -> Figure:
    """Panoramas above each other, each with a title and its detections."""
    ratio = rows[0][1].shape[0] / rows[0][1].shape[1]
    figure = Figure(
        figsize=(width_in, len(rows) * (width_in * ratio + 0.35)), dpi=DPI, layout="constrained"
    )
    for index, (title, panorama, detections) in enumerate(rows):
        axes = figure.add_subplot(len(rows), 1, index + 1)
        axes.set_title(title, fontsize=9, parse_math=False)
        axes.set_axis_off()
        axes.imshow(panorama)
        draw_detections(axes, panorama.shape[1], detections)
        axes.set_xlim(-0.5, panorama.shape[1] - 0.5)
        axes.set_ylim(panorama.shape[0] - 0.5, -0.5)
    return figure


def draw_detections(axes: Axes, width_px: int, detections: Sequence[Detection]) -> None:
    """Draw boxes with name, range and bearing; a box across the edge is drawn on both sides.

    Args:
        axes: axes with the panorama.
        width_px: width of the panorama.
        detections: detections in the panorama.
    """
    for box in detections:
        for shift in (0, -width_px) if box.right > width_px else (0,):
            left, right = box.left + shift, box.right + shift
            corner, size = (left - 1.5, box.top - 1.5), (right - left + 2, box.bottom - box.top + 2)
            for color, line in (("white", 1.6), (_BOX, 0.7)):
                axes.add_patch(Rectangle(corner, *size, fill=False, edgecolor=color, lw=line))
            label = f"{box.landmark}\n{box.range_m:.2f} m, {np.degrees(box.bearing_rad):.1f}°"
            axes.annotate(
                label, (0.5 * (left + right), box.bottom + 1.0), ha="center", va="top",
                fontsize=6.5, color=_BOX, annotation_clip=True,
                bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75},
            )  # fmt: skip


class Rates(NamedTuple):
    """Recall and precision by distance."""

    edges_m: Floats  # (n + 1,)
    recall: Floats  # (n,), NaN without landmarks
    precision: Floats  # (n,), NaN without detections


def rates_figure(rates: Mapping[str, Rates]) -> Figure:
    """Recall and precision by distance, with a color for each kind of image."""
    figure = Figure(figsize=(12.8, 3.8), dpi=DPI, layout="constrained")
    for column, name in enumerate(("recall", "precision")):
        axes = figure.add_subplot(1, 2, column + 1)
        label_axes(axes, f"{name} against distance", "distance (m)", name)
        for color, (label, by_distance) in zip(
            (BLUE, ORANGE, GREEN, RED), rates.items(), strict=False
        ):
            middles = 0.5 * (by_distance.edges_m[:-1] + by_distance.edges_m[1:])
            axes.plot(middles, getattr(by_distance, name), "-o", ms=3.5, color=color, label=label)
        axes.set_ylim(-0.03, 1.03)
        axes.legend(frameon=False, fontsize=8)
    return figure


def roc_figure(curves: Mapping[str, Sequence[tuple[str, Roc, float]]]) -> Figure:
    """ROC curves, one panel per kind of image.

    Args:
        curves: by title of the panel, each color's name, curve and chosen Θ.
    """
    figure = Figure(figsize=(6.4 * len(curves), 4.2), dpi=DPI, layout="constrained")
    for column, (title, panel) in enumerate(curves.items()):
        axes = figure.add_subplot(1, len(curves), column + 1)
        label_axes(axes, title, "false positives, share of neg's pixels", "true positives")
        for color, (name, curve, theta) in zip((BLUE, RED, ORANGE), panel, strict=False):
            rates = np.maximum(curve.false_positives, 1e-7)
            label = f"{name}, Θ = {theta:.0f}"
            axes.step(rates, curve.true_positives, where="post", color=color, label=label)
            chosen = int(np.searchsorted(-curve.thresholds, -theta, side="right")) - 1
            if chosen >= 0:
                at = (rates[chosen], curve.true_positives[chosen])
                axes.plot(*at, "o", color=color, ms=6, mec="white")
        axes.set_xscale("log")
        axes.set_ylim(0.0, 1.02)
        axes.legend(frameon=False, fontsize=8)
    return figure


def curves_figure(
    panels: Mapping[str, Sequence[tuple[str, Floats]]], levels: Sequence[str]
) -> Figure:
    """Quantities by level: one panel per quantity, and in it one line per degradation."""
    figure = Figure(figsize=(4.6 * len(panels), 4.0), dpi=DPI, layout="constrained")
    colors = (BLUE, ORANGE, GREEN, RED, GRAY, "#8054a0", "#b59a2e", "#3aa6a6")
    for column, (title, lines) in enumerate(panels.items()):
        axes = figure.add_subplot(1, len(panels), column + 1)
        label_axes(axes, title, "level", "")
        for color, (label, values) in zip(colors, lines, strict=False):
            axes.plot(np.arange(len(values)), values, "-o", ms=3.5, color=color, label=label)
        axes.set_xticks(range(len(levels)), levels)
        if column == 0:
            axes.legend(frameon=False, fontsize=7)
    return figure


@dataclass(frozen=True, eq=False)
class PathPanel:
    """Panel with one run."""

    title: str  # heading
    track: Track  # estimates
    true_poses: Floats | None  # (n, 3) x, y, yaw; None: unknown
    landmarks: Sequence[Landmark]  # landmarks at their true positions
    bound_m: float | None = None  # bound of the error, drawn as a line; None: no line


def paths_figure(panels: Sequence[PathPanel]) -> Figure:
    """True path, odometry and estimate from above, with ellipses of three sigma: Fig. 12."""
    figure = Figure(figsize=(6.4 * len(panels), 5.6), dpi=DPI, layout="constrained")
    for column, panel in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), column + 1)
        label_axes(axes, panel.title, "x (m)", "y (m)")
        for landmark in panel.landmarks:
            # footprints in the colors of the two upper bands: the lower outside, the upper inside
            x, y = landmark.position_m[:2]
            for size, band in zip((1.0, 0.55), landmark.bands[-2:], strict=False):
                width, depth = np.maximum(landmark.footprint_m, 0.18) * size
                corner = x - 0.5 * width, y - 0.5 * depth
                color = srgb_from_linear(band.linear_rgb)
                axes.add_patch(Rectangle(corner, width, depth, lw=0.6, edgecolor=_INK,
                                         facecolor=color, zorder=2))  # fmt: skip
            axes.plot(x, y, ".", ms=0.1)  # extends the axes
        track = panel.track
        reckoned, estimated = track.reckoned[:, :2].T, track.poses[:, :2].T
        axes.plot(*reckoned, "--", color=ORANGE, lw=1.3, label="odometry alone", zorder=3)
        if panel.true_poses is not None:
            axes.plot(*panel.true_poses[:, :2].T, color=BLUE, lw=2.4, label="true", zorder=4)
        axes.plot(*estimated, "-o", color=RED, lw=0.9, ms=2.6, label="estimate", zorder=6)
        _draw_ellipses(axes, track)
        axes.set_aspect("equal")
        axes.margins(0.06)
    common_legend(figure, loc="outside lower center", ncols=4, frameon=False)
    return figure


def errors_figure(panels: Sequence[PathPanel]) -> Figure:
    """Distance from the true position by step, and accepted landmarks: Fig. 13."""
    figure = Figure(figsize=(6.4 * len(panels), 5.0), dpi=DPI, layout="constrained")
    grid = figure.add_gridspec(2, len(panels), height_ratios=(3, 1))
    for column, panel in enumerate(panels):
        assert panel.true_poses is not None
        axes = figure.add_subplot(grid[0, column])
        label_axes(axes, panel.title, "", "distance from the truth (m), logarithmic")
        steps = np.arange(len(panel.track.estimates))
        for errors, line, color, label in (
            (panel.track.reckoned_errors_m(panel.true_poses), "--", ORANGE, "odometry alone"),
            (panel.track.errors_m(panel.true_poses), "-", RED, "estimate"),
        ):
            axes.plot(steps, np.maximum(errors, MIN_M), line, color=color, label=label)
        sigma = SIGMAS * np.sqrt(np.linalg.eigvalsh(panel.track.covariances[:, :2, :2])[:, -1])
        axes.plot(steps, np.maximum(sigma, MIN_M), ":", color=GRAY, lw=1.0, label="its own 3σ")
        if panel.bound_m is not None:
            axes.axhline(panel.bound_m, color=_INK, lw=0.8, ls="-.", label="the paper's bound")
        axes.set_yscale("log")
        axes.set_ylim(MIN_M, 10.0)
        axes.legend(frameon=False, fontsize=7, ncols=2, loc="upper left")
        below = figure.add_subplot(grid[1, column], sharex=axes)
        label_axes(below, "", "step", "landmarks")
        accepted, rejected = panel.track.counts(True), panel.track.counts(False)
        below.bar(steps, accepted, color=GREEN, width=0.9, label="accepted")
        below.bar(steps, -rejected, color=RED, width=0.9, label="rejected")
        below.axhline(0.0, color=_INK, lw=0.6)
        top = max(4, int(accepted.max(initial=0)))
        below.set_ylim(-max(3, int(rejected.max(initial=0))) - 0.5, top + 2.5)
        below.legend(frameon=False, fontsize=7, ncols=2, loc="upper right")
    return figure


def seeds_figure(errors_m: Floats, reckoned_m: Floats, title: str) -> Figure:
    """Errors (seeds, steps) of the estimate and of odometry alone: median and 95 % band."""
    figure = Figure(figsize=(8.0, 4.2), dpi=DPI, layout="constrained")
    axes = figure.add_subplot()
    label_axes(axes, title, "step", "distance from the truth (m), logarithmic")
    steps = np.arange(errors_m.shape[1])
    for values, color, label in (
        (reckoned_m, ORANGE, "odometry alone"),
        (errors_m, RED, "estimate"),
    ):
        shown = np.maximum(values, 1e-4)
        low, middle, high = np.percentile(shown, (2.5, 50.0, 97.5), axis=0)
        axes.fill_between(steps, low, high, color=color, alpha=0.18, lw=0)
        axes.plot(steps, middle, color=color, lw=1.6, label=f"{label}: median and 95 % band")
    axes.set_yscale("log")
    axes.legend(frameon=False, fontsize=8)
    return figure


def consistency_figure(
    nees: Floats, nees_interval: Interval, nis: Floats, nis_intervals: Sequence[Interval]
) -> Figure:
    """Mean NEES and mean NIS of all seeds by step, with 95 % bands.

    Args:
        nees: (steps,) means.
        nees_interval: 95 % interval of the means.
        nis: (steps,) means of NIS per degree of freedom.
        nis_intervals: 95 % interval of each mean.
    """
    figure = Figure(figsize=(12.8, 3.8), dpi=DPI, layout="constrained")
    edges = (np.full(len(nees), edge) for edge in nees_interval)
    panels = (
        ("NEES, mean of all seeds", nees, *edges),
        ("NIS over its degrees of freedom", nis, *np.array(nis_intervals).T),
    )
    for column, (title, values, low, high) in enumerate(panels):
        axes = figure.add_subplot(1, 2, column + 1)
        label_axes(axes, title, "step", "")
        steps = np.arange(1, len(values))  # the start is not estimated
        axes.fill_between(steps, low[1:], high[1:], color=GREEN, alpha=0.2, lw=0, label="95 % band")
        axes.plot(steps, values[1:], color=BLUE, lw=1.3, label="measured")
        axes.axhline(float(np.nanmean(values[1:])), color=GRAY, lw=0.9, ls="--", label="its mean")
        axes.set_ylim(bottom=0.0)
        axes.legend(frameon=False, fontsize=8)
    return figure


def _draw_ellipses(axes: Axes, track: Track) -> None:
    every = max(1, len(track.estimates) // 45)
    label = "its 3σ ellipse"
    for estimate in track.estimates[::every]:
        values, directions = np.linalg.eigh(estimate.covariance[:2, :2])
        x, y = estimate.pose[:2].tolist()
        width, height = 2.0 * SIGMAS * np.sqrt(np.maximum(values, 0.0))
        angle = np.degrees(np.arctan2(directions[1, 0], directions[0, 0]))
        axes.add_patch(
            Ellipse(
                (x, y), width, height, angle=float(angle), lw=0.7,
                edgecolor=RED, facecolor=RED, alpha=0.25, zorder=5, label=label,
            )
        )  # fmt: skip
        label = "_"
