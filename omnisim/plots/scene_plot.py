"""Plot of a scene from above: its map, paths, start poses and landmarks."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from omnisim.core.arrays import Floats
from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.plots.style import BLUE, GREEN, ORANGE, plot, show_between
from omnisim.scene import Scene
from omnisim.scene.model import Landmark
from omnisim.scene.space.floor import floor_height_m
from omnisim.scene.surface_kind import SurfaceKind, kind_of

# Larger scenes are shown around their starts, paths and landmarks, with this margin.
MAX_SIDE_M, AROUND_M = 30.0, 12.0
MARGIN = 0.03  # share of the larger side
CUT_M = 0.9  # height of the section above the ground
INK = "#222222"
_WALL = "#333333"
_PALE = 0.45  # share of white, for lines and points on top


def scene_figure(scene: Scene) -> Figure:
    """Top view of a scene, x to the right, y up: a section 0.9 m above the floor at the start."""
    low, high = scene.bounds_m()[:, :2]
    if (high - low).max() > MAX_SIDE_M:
        points = [scene.start.position_m[:2]]
        points += [start.position_m[:2] for start in scene.starts]
        points += [landmark.position_m[:2] for landmark in scene.landmarks]
        points += [point for path in scene.paths for point in path.waypoints_m]
        low = np.maximum(low, np.min(points, axis=0) - AROUND_M)
        high = np.minimum(high, np.max(points, axis=0) + AROUND_M)
        high = np.maximum(high, low + 1.0)
    margin = MARGIN * float((high - low).max())
    low, high = low - margin, high + margin
    width_in = 8.0
    height_in = float(np.clip(width_in * (high - low)[1] / (high - low)[0], 3.0, 12.0)) + 0.8
    figure, axes = plot(scene.name, "x (m)", "y (m)", width_in, height_in)
    start = scene.start
    ground_m = floor_height_m(scene, start.position_m[:2], start.position_m[2])
    draw_scene_map(axes, scene, low, high, ground_m or 0.0)
    for path in scene.paths:
        x, y = np.array(path.waypoints_m).T
        axes.plot(x, y, "-", color=BLUE, lw=1.6, zorder=3)
        axes.annotate(path.name, (x[0], y[0]), fontsize=8, color=BLUE, zorder=5)
    places = [("camera", start.position_m, start.yaw_deg, GREEN)]
    places += [(start.name, start.position_m, start.yaw_deg, ORANGE) for start in scene.starts]
    for name, (x, y, _), yaw_deg, color in places:
        yaw = np.radians(yaw_deg)
        axes.quiver(x, y, np.cos(yaw), np.sin(yaw), color=color, scale=24.0, width=0.005, zorder=4)
        axes.annotate(
            name, (x, y), textcoords="offset points", xytext=(4, -11),
            fontsize=8, color=color, zorder=5,
        )  # fmt: skip
    for landmark in scene.landmarks:
        draw_landmark(axes, landmark)
    show_between(axes, low, high)
    return figure


def draw_scene_map(
    axes: Axes, scene: Scene, low_m: Floats, high_m: Floats, ground_m: float = 0.0
) -> None:
    """Draw the scene between two corners (2,) of the ground, x to the right and y up.

    Args:
        low_m, high_m: corners of the drawn part.
        ground_m: height of the ground below the section.
    """
    cut_m = ground_m + CUT_M
    if not scene.instances:  # everything moves
        scene = scene.at_start()
    shown, heights, colors, walls = [], [], [], []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        material = scene.materials[mesh.material]
        matrix = instance.world_from_mesh
        corners = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        triangles = corners[mesh.triangles]
        inside = np.all(triangles[..., :2].min(axis=1) <= high_m, axis=1)
        inside &= np.all(triangles[..., :2].max(axis=1) >= low_m, axis=1)
        triangles = triangles[inside]
        z = triangles[..., 2]
        below = z.max(axis=1) < cut_m
        sides = triangles[:, 1:, :2] - triangles[:, :1, :2]
        below &= np.abs(np.linalg.det(sides)) > 1e-8  # twice the area, seen from above
        shown.append(triangles[below, :, :2])
        heights.append(z[below].mean(axis=1))
        color = np.array(material.base_color[:3])  # mean of the surface
        if material.texture is not None:
            sample = material.texture.pixels[::4, ::4, :3] / 255.0
            color = color * linear_from_srgb(sample).reshape(-1, 3).mean(axis=0)
        if mesh.colors is not None:
            color = color * mesh.colors[:, :3].mean(axis=0)
        pale = _PALE + (1.0 - _PALE) * srgb_from_linear(color)
        colors.append(np.tile(pale, (int(below.sum()), 1)))
        if not kind_of(material) & SurfaceKind.BLENDED:
            cut = (z.min(axis=1) < cut_m) & (z.max(axis=1) > cut_m)
            walls.append(_cross_sections(triangles[cut], cut_m))
    order = np.argsort(np.concatenate(heights), kind="stable")
    faces = np.concatenate(colors)[order]
    # edges in the same color hide hairlines of background between triangles
    outlines = list(np.concatenate(shown)[order])
    axes.add_collection(
        PolyCollection(outlines, facecolors=faces, edgecolors=faces, linewidths=0.3)
    )
    axes.add_collection(LineCollection(list(np.concatenate(walls)), colors=_WALL, linewidths=0.8))


def _cross_sections(triangles: Floats, cut_m: float) -> Floats:
    """Line segments (n, 2, 2) in which triangles (n, 3, 3) intersect the plane z = `cut_m`.

    Each triangle must have corners on both sides of the plane.
    """
    z = triangles[..., 2] - cut_m
    # the corner alone on its side, and the two others
    above = z > 0.0
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(triangles))
    ends = []
    for step in (1, 2):
        other = (alone + step) % 3
        share = z[rows, alone] / (z[rows, alone] - z[rows, other])
        start, end = triangles[rows, alone, :2], triangles[rows, other, :2]
        ends.append(start + share[:, None] * (end - start))
    return np.stack(ends, axis=1).reshape(-1, 2, 2)


def draw_landmark(axes: Axes, landmark: Landmark) -> None:
    """Draw a landmark's bands as squares, the lowest outermost, with the landmark's name below."""
    for index, band in enumerate(landmark.bands):
        axes.plot(
            *landmark.position_m[:2], "s", markersize=11 - 3 * index, zorder=4,
            color=srgb_from_linear(band.linear_rgb), markeredgecolor=INK, markeredgewidth=0.6,
        )  # fmt: skip
    axes.annotate(
        landmark.name, landmark.position_m[:2], textcoords="offset points", xytext=(0, -16),
        ha="center", fontsize=7, color=INK, zorder=5,
        path_effects=[withStroke(linewidth=2.0, foreground="white", alpha=0.8)],
    )  # fmt: skip
