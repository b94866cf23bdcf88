"""Plot of a calibration's residuals over the image."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omnisim.plots.style import BLUE, DPI, GRAY, ORANGE, label_axes

_MAX_ARROW = 0.04  # of the image's width: length of the 99th percentile's arrow


def residual_figure(
    title: str,
    size_px: tuple[int, int],
    pixels_px: NDArray[np.float64],
    errors_px: NDArray[np.float64],
) -> Figure:
    """Residuals as arrows over the image, and as a cloud.

    Args:
        title: title of the figure.
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
    ends = pixels_px + scale * errors_px
    field.plot(
        np.stack((pixels_px[:, 0], ends[:, 0])),
        np.stack((pixels_px[:, 1], ends[:, 1])),
        color=BLUE,
        linewidth=0.7,
    )
    field.plot(*pixels_px.T, ".", color=ORANGE, markersize=2.0)
    field.set_xlim(-0.5, width - 0.5)
    field.set_ylim(height - 0.5, -0.5)
    field.set_aspect("equal")
    label_axes(cloud, "Residuals", "u (px)", "v (px)")
    cloud.plot(*errors_px.T, ".", color=BLUE, markersize=2.5, alpha=0.6)
    cloud.axhline(0.0, color=GRAY, linewidth=0.6)
    cloud.axvline(0.0, color=GRAY, linewidth=0.6)
    limit = 1.1 * max(float(lengths.max()), 1e-9)
    cloud.set_xlim(-limit, limit)
    cloud.set_ylim(limit, -limit)
    cloud.set_aspect("equal")
    return figure
