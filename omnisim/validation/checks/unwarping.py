"""Unwarping: a view from the mirror's image against a pinhole camera's image; straight lines."""

from __future__ import annotations

import math

import numpy as np

from omnisim.cameras import CentralCamera, pixel_grid
from omnisim.core import coordinate_frames as frames
from omnisim.core import poses
from omnisim.core.arrays import Floats, Floats32
from omnisim.core.srgb import linear_from_srgb
from omnisim.perception.unwarping import Unwarping, View, perspective_view
from omnisim.plots.style import BLUE, GRAY, gallery, plot
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.validation.fixture import Fixture, linear_image, max_abs
from omnisim.validation.image_differences import psnr_db
from omnisim.validation.plain_scenes import WHITE, plain_scene, quads

IMAGE_PX, VIEW_PX = 1440, 320
YAW_DEG, PITCH_DEG = 30.0, 20.0
PSNR_BOUND_DB, LINE_BOUND_PX = 30.0, 0.5
BARS = 7


def check(fixture: Fixture, title: str) -> Section:
    """Unwarp an image of the textured scene, and one of straight bars."""
    supersampling = 1 if fixture.is_quick else 2
    sensor = OmniCamera(supersampling=supersampling).with_polygons(None).resized(IMAGE_PX)
    view = perspective_view(
        VIEW_PX, VIEW_PX, 0.5 * math.pi, math.radians(YAW_DEG), math.radians(PITCH_DEG)
    )
    unwarp = Unwarping(
        sensor.model, view.camera, frames.RIG_FROM_OPTICAL_LOOKING_UP.T @ view.base_from_view
    )
    frame = fixture.render(fixture.scene, sensor, sensor.base_pose(fixture.viewpoint_m))
    unwarped, pinhole = unwarp(linear_image(frame)), _pinhole(fixture)
    suffices = unwarp.valid & (_image_pixels_per_pixel(sensor, view) >= 1.0)
    psnr = psnr_db(unwarped, pinhole, suffices)
    bars = unwarp(_bars(fixture, sensor))
    lines = [_line(bars, view.camera, index) for index in range(BARS)]
    figure, axes = plot("Straight bars in the unwarped view", "u in pixels", "v − line in pixels")
    axes.set_ylim(-0.6, 0.6)
    bends = []
    for index, line in enumerate(lines):
        off = line[:, 1] - np.polyval(np.polyfit(line[:, 0], line[:, 1], 1), line[:, 0])
        bends.append(max_abs(off) if len(line) > 50 else math.nan)
        axes.plot(line[:, 0], off, color=BLUE if index % 2 else GRAY, linewidth=0.8)
    shown = {"unwarped": unwarped, "pinhole camera": pinhole}
    masked = {name: np.where(unwarp.valid[..., None], x, 0.0) for name, x in shown.items()}
    return Section(
        title,
        f"A 90° view of {VIEW_PX} px, unwarped from the mirror's image of {IMAGE_PX} px, against "
        "the image of a pinhole camera at the effective viewpoint, where the mirror's image has at "
        f"least the view's resolution ({100.0 * suffices.mean():.0f} % of the view). Then the "
        f"straightness of {BARS} straight bars in the view.",
        (
            Measure("unwarped view against the pinhole camera's", psnr, "dB", PSNR_BOUND_DB,
                    at_least=True),
            Measure("largest distance of a bar from a straight line", max(bends), "px",
                    LINE_BOUND_PX),
            Measure("columns that the bars were measured in", sum(len(line) for line in lines)),
        ),
        figures=(
            CaptionedFigure("unwarped", gallery(masked | {"bars, unwarped": bars}, 3),
                    "The view unwarped from the mirror's image, the image of a pinhole camera, and "
                    "unwarped straight bars."),
            CaptionedFigure("straight-bars", figure,
                    "Distance of each bar from its fitted straight line."),
        ),
    )  # fmt: skip


def _pinhole(fixture: Fixture) -> Floats32:
    """Image of a pinhole camera: the front face of a rig with the yaw and pitch of the view."""
    fine = 4  # its pixels are averages, too
    sensor = OmniCamera(face_size_px=fine * VIEW_PX)
    pose = poses.pose(fixture.viewpoint_m, pitch_deg=PITCH_DEG, yaw_deg=YAW_DEG)
    with open_sensor(fixture.scene, sensor, unlit=True, device=fixture.device) as renderer:
        renderer.render(pose)
        face = linear_from_srgb(renderer.faces()["front"] / 255.0)
    averaged: Floats = face.reshape(VIEW_PX, fine, VIEW_PX, fine, 3).mean(axis=(1, 3))
    return averaged.astype(np.float32)


def _image_pixels_per_pixel(sensor: OmniCamera, view: View) -> Floats:
    """Pixels of the mirror's image per pixel of the view, along the coarser direction."""
    grid = pixel_grid(view.camera.width_px, view.camera.height_px)
    rotation = frames.RIG_FROM_OPTICAL_LOOKING_UP.T @ view.base_from_view

    def project(step: tuple[float, float]) -> Floats:
        directions = view.camera.ray_from_pixel(grid + step).directions @ rotation.T
        return sensor.model.pixel_from_ray(directions).positions_px

    u, v = ((0.5, 0.0), (0.0, 0.5))
    steps = [project(step) - project((-step[0], -step[1])) for step in (u, v)]
    # NumPy's stubs give singular values any precision
    singular = np.linalg.svd(np.stack(steps, axis=-1), compute_uv=False)
    return np.asarray(singular[..., 1], dtype=np.float64)


def _bars(fixture: Fixture, sensor: OmniCamera) -> Floats32:
    """Image (height, width, 3) of white bars on black: long, slightly inclined, stacked."""
    forward = np.array([math.cos(math.radians(YAW_DEG)), math.sin(math.radians(YAW_DEG)), 0.0])
    side = np.array([-forward[1], forward[0], 0.0])
    corners = []
    for index in range(BARS):
        # at equal steps down the view, slightly inclined, 2 m ahead
        slope = 0.04 * (index - 3)
        down = math.tan(math.radians(PITCH_DEG - 30.0 + 10.0 * index))
        middle = 2.0 * forward - np.array([0.0, 0.0, 2.0 * down])
        along = 4.0 * (side + np.array([0.0, 0.0, slope]))
        half = np.array([0.0, 0.0, 0.016])
        corners.append([middle - along - half, middle + along - half,
                        middle + along + half, middle - along + half])  # fmt: skip
    scene = plain_scene("bars", (quads("bars", corners), WHITE))
    return linear_image(fixture.render(scene, sensor, np.eye(4)))


def _line(bars: Floats32, camera: CentralCamera, index: int) -> Floats:
    """Positions (n, 2) of a bar in the columns of the view that show it completely."""
    directions = math.radians(PITCH_DEG - 30.0 + 10.0 * index)
    gray = bars[..., 1].astype(np.float64)
    focal, middle = 0.5 * camera.width_px, 0.5 * (camera.height_px - 1)
    expected = middle + focal * math.tan(directions - math.radians(PITCH_DEG))
    rows_by_column: dict[int, float] = {}
    start = camera.width_px // 2
    for columns in (range(start, camera.width_px - 8), range(start - 1, 7, -1)):
        near = expected if not rows_by_column else rows_by_column[start]
        for u in columns:
            rows = np.arange(round(near) - 7, round(near) + 8)
            if rows[0] < 0 or rows[-1] >= camera.height_px:
                break
            column = gray[rows, u]
            if column.sum() > 0.5 and max(column[0], column[-1]) < 0.01:
                near = rows_by_column[u] = float((column * rows).sum() / column.sum())
    return np.array(sorted(rows_by_column.items()))
