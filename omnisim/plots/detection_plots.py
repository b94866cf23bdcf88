"""Detections: boxes in panoramas, rates by distance, ROC curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from omnisim.perception.landmarks.color_model import Roc
from omnisim.perception.landmarks.landmark_detector import Detection
from omnisim.plots.style import BLUE, DPI, GRAY, GREEN, ORANGE, RED, label_axes

_BOX = "#111111"


def detections_figure(
    rows: Sequence[tuple[str, NDArray[np.uint8], Sequence[Detection]]], width_in: float = 13.0
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

    edges_m: NDArray[np.float64]  # (n + 1,)
    recall: NDArray[np.float64]  # (n,), NaN without landmarks
    precision: NDArray[np.float64]  # (n,), NaN without detections


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
    panels: Mapping[str, Sequence[tuple[str, NDArray[np.float64]]]],
    levels: Sequence[str],
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
