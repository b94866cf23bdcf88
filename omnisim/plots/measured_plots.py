"""Plots of `omnisim measure`: measured quantities, residuals, and a camera's simulated twin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnisim.core.arrays import Floats
from omnisim.measurement.comparison.comparison import Comparison, ImageComparison
from omnisim.plots.style import BLUE, DPI, GRAY, GREEN, ORANGE, RED, label_axes, plot, show_between

_COLORS = {"gray": GRAY, "red": RED, "green": GREEN, "blue": BLUE}
_SIGMAS = 2.0  # length of error bars
_MAX_ARROW = 0.04  # of the image's width: length of the 99th percentile's arrow
_SMALL_PX = 0.05  # least extent of the axis of biases
_GAIN = 2.0  # of differences, around middle gray


def photon_transfer_figure(
    means_dn: Sequence[float],
    variances_dn2: Sequence[float],
    used: Sequence[bool],
    gain_e_per_dn: float,
) -> Figure:
    """Photon transfer curve.

    Args:
        means_dn, variances_dn2: (levels,) means and variances, minus those of the dark frames.
        used: (levels,) True: the level is part of the fit of the gain.
        gain_e_per_dn: fitted gain, the inverse of the slope.
    """
    means, variances = np.asarray(means_dn), np.asarray(variances_dn2)
    fitted = np.asarray(used, dtype=bool)
    figure, axes = plot(
        "Photon transfer curve", "mean minus dark (DN)", "variance minus dark (DN²)"
    )
    axes.plot(means[fitted], variances[fitted], "o", color=BLUE, label="fitted")
    axes.plot(means[~fitted], variances[~fitted], "o", color=GRAY, label="not fitted")
    ends = np.array((0.0, means.max(initial=1.0, where=fitted)))
    axes.plot(ends, ends / gain_e_per_dn, color=ORANGE, label=f"{gain_e_per_dn:.4g} e/DN")
    axes.legend(fontsize=8, loc="upper left")
    return figure


def response_figure(light: Sequence[float], levels: Sequence[float]) -> Figure:
    """Level by light, each relative to its maximum, beside a linear response and gamma 2.2."""
    figure, axes = plot("Response", "light", "level", width_in=5.5)
    grid = np.linspace(0.0, 1.0, 201)
    axes.plot(grid, grid, "--", color=GRAY, linewidth=0.8, label="linear")
    axes.plot(grid, grid ** (1.0 / 2.2), ":", color=GRAY, linewidth=1.0, label="gamma 2.2")
    axes.plot(light, levels, "o-", color=BLUE, markersize=3.0, label="measured")
    axes.legend(fontsize=8, loc="lower right")
    return figure


def vignetting_figure(channels: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Light by image radius of each channel: parts of the image as points, polynomials as lines.

    Args:
        channels: `radius`, `light` and `fitted` of each channel, by its name.
    """
    figure, axes = plot("Vignetting", "radius (in half shorter sides)", "relative light")
    for name, channel in channels.items():
        color, radii = _COLORS.get(name, GRAY), np.asarray(channel["radius"])
        order = np.argsort(radii)
        axes.plot(radii, channel["light"], ".", color=color, markersize=2.0, alpha=0.5)
        axes.plot(radii[order], np.asarray(channel["fitted"])[order], color=color, label=name)
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8, loc="lower left")
    return figure


def sharpness_figure(edges: Sequence[Mapping[str, Any]], center_px: Sequence[float]) -> Figure:
    """MTF50 of edges and the shifts of red and blue against green, by image radius.

    Args:
        edges: `center_px`, `normal`, `mtf50`, `red_shift_px` and `blue_shift_px` of each edge; the
            last three are pairs of a value and its standard deviation, or None.
        center_px: center of the field.
    """
    figure = Figure(figsize=(12.0, 4.2), dpi=DPI, layout="constrained")
    spread, color = figure.subplots(1, 2)
    label_axes(spread, "MTF50 of edges", "radius (px)", "cycles per pixel")
    label_axes(color, "Red and blue edges, outward from the green ones", "radius (px)", "px")
    offsets = np.array([edge["center_px"] for edge in edges]).reshape(-1, 2) - center_px
    normals = np.array([edge["normal"] for edge in edges]).reshape(-1, 2)
    radii = np.linalg.norm(offsets, axis=1)
    outward = (offsets * normals).sum(axis=1) / np.maximum(radii, 1e-9)
    is_radial = np.abs(outward) > np.sqrt(0.5)
    mtf50 = np.array([edge["mtf50"] for edge in edges]).reshape(-1, 2)
    _bars(spread, radii[is_radial], mtf50[is_radial], BLUE, "radial")
    _bars(spread, radii[~is_radial], mtf50[~is_radial], ORANGE, "tangential")
    spread.set_ylim(bottom=0.0)
    spread.legend(fontsize=8, loc="lower left")
    for name, tone in (("red", RED), ("blue", BLUE)):
        shifts = [edge[f"{name}_shift_px"] for edge in edges]
        group = is_radial & np.array([shift is not None for shift in shifts], dtype=bool)
        values = np.array([shifts[row] for row in np.flatnonzero(group)]).reshape(-1, 2)
        _bars(color, radii[group], values / outward[group, None], tone, name)
    color.axhline(0.0, color=GRAY, linewidth=0.6)
    color.legend(fontsize=8, loc="lower left")
    return figure


def _bars(axes: Axes, radii: Floats, values: Floats, color: str, name: str) -> None:
    """Draw values (n, 2) with bars of two standard deviations."""
    bars = _SIGMAS * np.abs(values[:, 1])
    axes.errorbar(radii, values[:, 0], bars, fmt=".", color=color, linewidth=0.8, label=name)


def timing_figure(profile: Sequence[float], fitted: Sequence[float], lines: str) -> Figure:
    """Relative light of a frame's lines, with the scene removed, and fitted bands of the lamp.

    Args:
        profile, fitted: (lines,) relative light.
        lines: "rows" or "columns".
    """
    figure, axes = plot("Flicker bands", lines, "relative light")
    axes.plot(profile, color=BLUE, linewidth=0.9, label="measured")
    axes.plot(fitted, color=ORANGE, linewidth=1.2, label="fitted")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.15 * (high - low))  # room for the legend
    axes.legend(fontsize=8, loc="upper right", ncols=2)
    return figure


def residual_figure(
    title: str, size_px: tuple[int, int], pixels_px: Floats, errors_px: Floats
) -> Figure:
    """Residuals as arrows over the image, and as a cloud.

    Args:
        size_px: width and height of the images.
        pixels_px: (n, 2) measured corners.
        errors_px: (n, 2) measured minus predicted corners.
    """
    width, height = size_px
    figure = Figure(figsize=(11.0, 1.2 + 6.0 * height / width), dpi=DPI, layout="constrained")
    field, cloud = figure.subplots(1, 2, width_ratios=(1.6, 1.0))
    lengths = np.linalg.norm(errors_px, axis=1)
    longest = max(float(np.percentile(lengths, 99.0)), 1e-9)
    scale = _MAX_ARROW * width / longest
    label_axes(field, f"{title}; arrows × {scale:.0f}", "u (px)", "v (px)")
    arrows = np.stack((pixels_px, pixels_px + scale * errors_px))
    field.plot(arrows[..., 0], arrows[..., 1], color=BLUE, linewidth=0.7)
    field.plot(*pixels_px.T, ".", color=ORANGE, markersize=2.0)
    show_between(field, (-0.5, height - 0.5), (width - 0.5, -0.5))
    label_axes(cloud, "Residuals", "u (px)", "v (px)")
    cloud.plot(*errors_px.T, ".", color=BLUE, markersize=2.5, alpha=0.6)
    cloud.axhline(0.0, color=GRAY, linewidth=0.6)
    cloud.axvline(0.0, color=GRAY, linewidth=0.6)
    limit = 1.1 * max(float(lengths.max()), 1e-9)
    show_between(cloud, (-limit, limit), (limit, -limit))
    return figure


def sheet_figure(images: Sequence[ImageComparison]) -> Figure:
    """Rows of an image, its twin and their difference."""
    ratio = images[0].image.shape[0] / images[0].image.shape[1]
    size = (12.0, len(images) * (4.0 * ratio + 0.3))
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    axes = np.atleast_2d(figure.subplots(len(images), 3))
    for row, pair in zip(axes, images, strict=True):
        difference = 128.0 + _GAIN * (pair.twin.astype(np.float64) - pair.image)
        titles = pair.name, "twin", f"twin minus image, × {_GAIN:g}"
        shown_images = pair.image, pair.twin, difference
        for place, title, shown in zip(row, titles, shown_images, strict=True):
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
    for index, (name, color) in enumerate((("radial", BLUE), ("tangential", ORANGE))):
        values = [ring.bias_px[index] for ring in comparison.rings]
        offsets.plot(radii, values, "o-", color=color, label=name)
    offsets.axhline(0.0, color=GRAY, linewidth=0.6)
    low, high = offsets.get_ylim()
    offsets.set_ylim(min(low, -_SMALL_PX), max(high, _SMALL_PX))
    offsets.legend(fontsize=8)
    label_axes(rises, "10–90 % rise of edges", "radius (px)", "rise (px)")
    for name, color, attribute in (("images", BLUE, "rise_px"), ("twin", ORANGE, "twin_rise_px")):
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
    levels = [band.level for band in comparison.noise]
    for name, color, attribute in (("images", BLUE, "noise"), ("twin", ORANGE, "twin_noise")):
        values = [getattr(band, attribute) for band in comparison.noise]
        axes.plot(levels, values, "o-", color=color, label=name)
    axes.set_xlim(0.0, 255.0)
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8)
    return figure
