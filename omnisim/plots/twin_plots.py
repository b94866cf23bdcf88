"""Plots that compare a camera's images with those of its simulated twin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from omnisim.measurement.comparison.comparison import Comparison, ImageComparison
from omnisim.plots.style import BLUE, DPI, GRAY, ORANGE, label_axes

_SMALL_PX = 0.05  # least extent of the axis of biases
_GAIN = 2.0  # of differences, around middle gray


def sheet_figure(images: Sequence[ImageComparison]) -> Figure:
    """Rows of an image, its twin and their difference."""
    ratio = images[0].image.shape[0] / images[0].image.shape[1]
    size = (12.0, len(images) * (4.0 * ratio + 0.3))
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = np.atleast_2d(figure.subplots(len(images), 3))
    for row, one in zip(axes, images, strict=True):
        difference = 128.0 + _GAIN * (one.twin.astype(np.float64) - one.image)
        titles = one.name, "twin", f"twin minus image, × {_GAIN:g}"
        for place, title, shown in zip(row, titles, (one.image, one.twin, difference), strict=True):
            place.set_title(title, fontsize=9)
            place.imshow(shown, cmap="gray", vmin=0, vmax=255)
            place.set_axis_off()
    return figure


def edge_figure(comparison: Comparison) -> Figure:
    """Offsets of corners, and rise of edges, by the radius in the image."""
    figure = Figure(figsize=(12.0, 4.2), dpi=DPI, layout="constrained")
    offsets, rises = figure.subplots(1, 2)
    label_axes(offsets, "Bias of corners by ring", "radius (px)", "twin minus image (px)")
    radii = [ring.radius_px for ring in comparison.rings]
    for index, (name, color) in enumerate((("along the radius", BLUE), ("across", ORANGE))):
        values = [ring.bias_px[index] for ring in comparison.rings]
        offsets.plot(radii, values, "o-", color=color, label=name)
    offsets.axhline(0.0, color=GRAY, linewidth=0.6)
    low, high = offsets.get_ylim()
    offsets.set_ylim(min(low, -_SMALL_PX), max(high, _SMALL_PX))
    offsets.legend(fontsize=8)
    label_axes(rises, "10–90 % rise of edges", "radius (px)", "rise (px)")
    for name, color, attribute in (
        ("images", BLUE, "rise_px"),
        ("twin", ORANGE, "twin_rise_px"),
    ):
        values = [getattr(ring, attribute) for ring in comparison.rings]
        rises.plot(radii, values, "o-", color=color, label=name)
    rises.set_ylim(bottom=0.0)
    rises.legend(fontsize=8)
    return figure


def noise_figure(comparison: Comparison) -> Figure:
    """Noise of images and twin by gray level."""
    figure = Figure(figsize=(6.0, 4.2), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    label_axes(axes, "Noise", "gray level", "standard deviation (gray levels)")
    levels = [one.level for one in comparison.noise]
    for name, color, attribute in (("images", BLUE, "noise"), ("twin", ORANGE, "twin_noise")):
        values = [getattr(one, attribute) for one in comparison.noise]
        axes.plot(levels, values, "o-", color=color, label=name)
    axes.set_xlim(0.0, 255.0)
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8)
    return figure
