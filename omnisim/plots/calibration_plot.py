"""Plots of `omnisim calibration check`: fields, other formats, and straight lines in an image."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, PerspectiveCamera
from omnisim.cameras.calibration.calibrated_camera import Residuals
from omnisim.cameras.calibration.calibration_check import OtherFormats, is_reached, pixels_over
from omnisim.cameras.models.field_of_view import angles_from_axis, edge_pixels, optical_axis
from omnisim.core.srgb import srgb8_from_linear
from omnisim.perception.unwarping import Unwarping
from omnisim.plots.style import BLUE, DPI, GRAY, ORANGE, common_legend, label_axes, show_between

_GRID, _BINS = 193, 48  # pixels per side, and angles
_STEP_DEG = 15  # between lines, and between circles of equal angle
_MAX_VIEW_DEG = 100.0  # wider perspective views stretch their edges
_LABEL_COLUMNS, _MIN_PX = 44, 1e-4  # smaller differences matter to nobody


def check_figure(
    cameras: Mapping[str, tuple[CentralCamera, object, Sequence[OtherFormats]]],
) -> Figure:
    """Angles over each camera's image, and the other formats' differences by angle."""
    figure = Figure(figsize=(15.0, 4.4 * len(cameras) + 0.4), dpi=DPI, layout="constrained")
    rows = figure.subplots(len(cameras), 2, squeeze=False, width_ratios=(1.0, 1.3))
    colors: dict[str, str] = {}  # by the first format: the same for all cameras
    for (field, difference), (name, (camera, _, others)) in zip(rows, cameras.items(), strict=True):
        label_axes(field, f"{name}: angle from the axis", "u (px)", "v (px)")
        _draw_field(field, camera)
        title, y_label = f"{name} in other formats", "largest difference (px)"
        label_axes(difference, title, "angle from the axis (°)", y_label)
        exact = [name for each in others if each.is_exact for name in each.formats]
        difference.plot([], [], " ", label=_label("exact", exact))
        fitted: dict[Residuals, list[OtherFormats]] = {}
        for each in others:
            if each.residuals is not None:
                fitted.setdefault(each.residuals, []).append(each)
        for same in fitted.values():
            label = _label(same[0].model, [name for each in same for name in each.formats])
            color = colors.setdefault(same[0].formats[0], f"C{len(colors)}")
            difference.plot(*_differences(camera, same[0]), color=color, label=label)
        if difference.dataLim.intervaly[1] > _MIN_PX:  # whole decades: their ticks have labels
            difference.set_yscale("log")
            ends = np.log10(np.maximum(difference.dataLim.intervaly, _MIN_PX))
            difference.set_ylim(10.0 ** math.floor(ends[0]), 10.0 ** math.ceil(ends[1] + 1e-9))
            difference.yaxis.set_major_formatter("{x:g}")
        difference.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))
    shown = rows[0, 0].get_legend_handles_labels()
    figure.legend(*shown, loc="outside lower left", ncols=4, fontsize=8)
    return figure


def _label(title: str, names: Sequence[str]) -> str:
    return "\n".join(textwrap.wrap(f"{title}: {', '.join(names)}", _LABEL_COLUMNS))


def _draw_field(axes: Axes, camera: CentralCamera) -> None:
    """Draw circles of equal angle; black: invalid, white: in reach of a board's corners."""
    pixels = pixels_over(camera, _GRID)
    rays = camera.ray_from_pixel(pixels)
    u, v, thetas = (
        values.reshape(_GRID, _GRID)
        for values in (*pixels.T, angles_from_axis(rays.directions, optical_axis(camera)))
    )
    valid, reached = (
        mask.reshape(_GRID, _GRID) for mask in (rays.valid, is_reached(camera, pixels))
    )
    axes.grid(visible=False)
    extent = (-0.5, camera.width_px - 0.5, camera.height_px - 0.5, -0.5)
    shades = np.where(reached, 1.0, np.where(valid, 0.85, 0.15))
    axes.imshow(shades, cmap="gray", vmin=0.0, vmax=1.0, extent=extent)
    levels, degrees = (
        np.arange(_STEP_DEG, 180, _STEP_DEG),
        np.where(valid, np.degrees(thetas), np.nan),
    )
    lines = axes.contour(u, v, degrees, levels, colors=BLUE, linewidths=0.9)
    axes.clabel(lines, fmt="%d°", fontsize=8)
    edge, middle = edge_pixels(camera, 360), 0.5 * (np.array(extent[1:3]) - 0.5)
    axes.plot(*edge.T, color=ORANGE, linewidth=1.2, label="edge of the valid pixels")
    axes.plot(*camera.principal_point_px, "+", color=ORANGE, markersize=10, label="principal point")
    axes.plot(*middle, "x", color=GRAY, markersize=7, label="middle of the image")
    axes.fill([], [], color="0.85", label="out of reach of a board's corners")


def _differences(camera: CentralCamera, other: OtherFormats) -> tuple[list[float], list[float]]:
    """Angles (n,) from the axis, in degrees, and the largest difference about each, in pixels."""
    assert other.camera is not None
    pixels = pixels_over(camera, _GRID)
    rays = camera.ray_from_pixel(pixels)
    with np.errstate(all="ignore"):  # at the edge of a fitted lens
        seen = other.camera.pixel_from_ray(rays.directions)
    both = rays.valid & seen.valid
    thetas = np.degrees(angles_from_axis(rays.directions[both], optical_axis(camera)))
    apart_px = np.linalg.norm(seen.positions_px - pixels, axis=-1)[both]
    edges = np.linspace(0.0, float(thetas.max(initial=0.0)) + 1e-9, _BINS + 1)
    largest_px = np.full(_BINS, np.nan)
    np.fmax.at(largest_px, np.digitize(thetas, edges) - 1, apart_px)
    return (0.5 * (edges[1:] + edges[:-1])).tolist(), largest_px.tolist()


def lines_figure(name: str, photo: NDArray[Any], camera: CentralCamera) -> Figure:
    """Image with lines that are straight in the world, and without distortion.

    If the calibration is right, straight edges of the scene follow such lines in the image, and are
    straight in the perspective view along the axis.

    Args:
        photo: (height, width, channels) of the camera's size: 8 or 16 bits, or linear floats.
    """
    image = photo[..., [0] * 3] if photo.shape[2] < 3 else photo[..., :3]
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    image = image if image.dtype == np.uint8 else srgb8_from_linear(image)
    axis = optical_axis(camera)
    edge = edge_pixels(camera, 720)
    thetas = angles_from_axis(camera.ray_from_pixel(edge).directions, axis)
    size_px = camera.width_px, camera.height_px
    view_rad = min(math.radians(_MAX_VIEW_DEG), 2.0 * float(thetas.max()))
    focal_px = 0.5 * max(size_px) / math.tan(0.5 * view_rad)
    view = PerspectiveCamera(*size_px, focal_px, (0.5 * size_px[0] - 0.5, 0.5 * size_px[1] - 0.5))
    turn = np.diag([1.0, axis, axis])  # a mirror looks back
    straight = Unwarping(camera, view, turn)(image)
    height_in = 7.0 * camera.height_px / camera.width_px + 0.8
    figure = Figure(figsize=(14.0, height_in), dpi=DPI, layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(*edge.T, color=ORANGE, linewidth=1.4, label="edge of the valid pixels")
    left.plot(*camera.principal_point_px, "+", color=ORANGE, ms=12, label="principal point")
    left.plot([], [], color=BLUE, label=f"lines that are straight in the world, every {_STEP_DEG}°")
    title = f"without distortion, {math.degrees(view_rad):.0f}°: straight edges are straight"
    along = np.radians(np.linspace(-89.9, 89.9, 721))
    for axes, pixels, lens, rotation, text in (
        (left, image, camera, np.eye(3), name), (right, straight, view, turn, title),
    ):  # fmt: skip
        axes.set_title(text, fontsize=10)
        axes.imshow(pixels)
        for angle in np.radians(np.arange(-75, 76, _STEP_DEG)):
            across, ahead = math.sin(angle) * np.cos(along), math.cos(angle) * np.cos(along)
            for x, y in ((across, np.sin(along)), (np.sin(along), across)):
                seen = lens.pixel_from_ray(np.stack((x, y, axis * ahead), axis=-1) @ rotation)
                shown = np.where(seen.valid[:, None], seen.positions_px, np.nan)
                axes.plot(*shown.T, color=BLUE, linewidth=0.9)
        show_between(axes, (-0.5, lens.height_px - 0.5), (lens.width_px - 0.5, -0.5))
        axes.set_axis_off()
    common_legend(figure, loc="outside lower left", ncols=3, fontsize=9)
    return figure
