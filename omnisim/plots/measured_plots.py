"""Plots of the quantities that `omnisim measure` finds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omnisim.plots.style import BLUE, DPI, GRAY, GREEN, ORANGE, RED, label_axes, plot

_COLORS = {"gray": GRAY, "red": RED, "green": GREEN, "blue": BLUE}
_SIGMAS = 2.0  # length of error bars


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
    figure, axes = plot("Photon transfer", "mean minus dark (DN)", "variance minus dark (DN²)")
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
    figure, axes = plot("Vignetting", "radius (halves of the shorter side)", "relative light")
    for name, one in channels.items():
        color, radii = _COLORS.get(name, GRAY), np.asarray(one["radius"])
        order = np.argsort(radii)
        axes.plot(radii, one["light"], ".", color=color, markersize=2.0, alpha=0.5)
        axes.plot(radii[order], np.asarray(one["fitted"])[order], color=color, label=name)
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
    offsets = np.array([one["center_px"] for one in edges]).reshape(-1, 2) - center_px
    normals = np.array([one["normal"] for one in edges]).reshape(-1, 2)
    radii = np.linalg.norm(offsets, axis=1)
    outward = (offsets * normals).sum(axis=1) / np.maximum(radii, 1e-9)
    is_radial = np.abs(outward) > np.sqrt(0.5)
    for name, group, tone in (
        ("along the radius", is_radial, BLUE),
        ("across it", ~is_radial, ORANGE),
    ):
        values = np.array([one["mtf50"] for one in edges]).reshape(-1, 2)[group]
        _bars(spread, radii[group], values, tone, name)
    spread.set_ylim(bottom=0.0)
    spread.legend(fontsize=8, loc="lower left")
    for name, tone in (("red", RED), ("blue", BLUE)):
        shifts = [one[f"{name}_shift_px"] for one in edges]
        group = is_radial & np.array([shift is not None for shift in shifts], dtype=bool)
        values = np.array([shifts[row] for row in np.flatnonzero(group)]).reshape(-1, 2)
        _bars(color, radii[group], values / outward[group, None], tone, name)
    color.axhline(0.0, color=GRAY, linewidth=0.6)
    color.legend(fontsize=8, loc="lower left")
    return figure


def _bars(
    axes: Axes, radii: NDArray[np.float64], values: NDArray[np.float64], color: str, name: str
) -> None:
    """Draw values (n, 2) with bars of two standard deviations."""
    bars = _SIGMAS * np.abs(values[:, 1])
    axes.errorbar(radii, values[:, 0], bars, fmt=".", color=color, linewidth=0.8, label=name)


def timing_figure(profile: Sequence[float], fitted: Sequence[float], lines: str) -> Figure:
    """Relative light of a frame's lines, with the scene removed, and fitted bands of the lamp.

    Args:
        profile, fitted: (lines,) relative light.
        lines: "rows" or "columns".
    """
    figure, axes = plot("Bands of the lamp", lines, "relative light")
    axes.plot(profile, color=BLUE, linewidth=0.9, label="measured")
    axes.plot(fitted, color=ORANGE, linewidth=1.2, label="fitted")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.15 * (high - low))  # room for the legend
    axes.legend(fontsize=8, loc="upper right", ncols=2)
    return figure
