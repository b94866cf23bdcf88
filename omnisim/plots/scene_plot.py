"""Plot of a scene from above: its map, paths, start poses and landmarks."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omnisim.plots.run_plot import draw_landmark
from omnisim.plots.scene_map import draw_scene_map
from omnisim.plots.style import BLUE, GREEN, ORANGE, plot
from omnisim.scene import Scene
from omnisim.scene.space.floor import floor_height_m

# Larger scenes are shown around their starts, paths and landmarks, with this margin.
MAX_SIDE_M, AROUND_M = 30.0, 12.0
MARGIN = 0.03  # share of the larger side


def scene_figure(scene: Scene) -> Figure:
    """Top view of a scene, x to the right, y up: a section 0.9 m above the floor at the start."""
    low, high = _extent(scene)
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
    places += [(one.name, one.position_m, one.yaw_deg, ORANGE) for one in scene.starts]
    for name, (x, y, _), yaw_deg, color in places:
        yaw = np.radians(yaw_deg)
        axes.quiver(x, y, np.cos(yaw), np.sin(yaw), color=color, scale=24.0, width=0.005, zorder=4)
        axes.annotate(
            name, (x, y), textcoords="offset points", xytext=(4, -11),
            fontsize=8, color=color, zorder=5,
        )  # fmt: skip
    for landmark in scene.landmarks:
        draw_landmark(axes, landmark)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    return figure


def _extent(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (2,) of the shown part."""
    low, high = scene.bounds_m()[:, :2]
    if (high - low).max() <= MAX_SIDE_M:
        return low, high
    points = [scene.start.position_m[:2]]
    points += [one.position_m[:2] for one in scene.starts]
    points += [one.position_m[:2] for one in scene.landmarks]
    points += [point for path in scene.paths for point in path.waypoints_m]
    near, far = np.min(points, axis=0) - AROUND_M, np.max(points, axis=0) + AROUND_M
    low, high = np.maximum(low, near), np.minimum(high, far)
    return low, np.maximum(high, low + 1.0)
