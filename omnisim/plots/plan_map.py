"""Maps of a plan: each scene's free floor, with the positions of its first samples."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from omnisim.datasets.free_space import FreeSpace
from omnisim.datasets.generate.draw import Draw, draw, draw_indices
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.plots.scene_plot import draw_scene_map
from omnisim.plots.style import BLUE, DPI, GREEN, ORANGE, label_axes, show_between

MAX_SAMPLES = 400  # number of places shown
AROUND_M = 1.5
SIDE_IN = 7.0


def plan_figure(prepared: PreparedPlan) -> Figure:
    """Free floor and sample positions of each scene of a plan, from above: x to the right, y up.

    Raises:
        OmnisimError: a faulty file of the plan, or no free position was found.
    """
    plan = prepared.plan
    drawn: list[list[Draw]] = [[] for _ in plan.scenes]
    for number in range(min(plan.images, MAX_SAMPLES)):
        drawn[draw_indices(plan, number).scene].append(draw(prepared, number, 0))
    columns = min(len(plan.scenes), 3)
    rows = -(-len(plan.scenes) // columns)
    size_in = (columns * SIDE_IN, rows * SIDE_IN)
    figure = Figure(figsize=size_in, dpi=DPI, layout="constrained")
    for number, samples in enumerate(drawn):
        axes = figure.add_subplot(rows, columns, number + 1)
        needs_floor = plan.viewpoints.where != "poses" or prepared.objects
        free = prepared.free_space(number) if needs_floor else None
        _draw_scene(axes, prepared, number, free, samples)
    return figure


def _draw_scene(
    axes: Axes, prepared: PreparedPlan, number: int, free: FreeSpace | None, samples: list[Draw]
) -> None:
    scene = prepared.scene(number)
    points = np.array([sample.position_m[:2] for sample in samples]).reshape(-1, 2)
    places = [points] if len(points) else [np.array([scene.start.position_m[:2]])]
    if free is not None:
        cells = free.free_cells()[:, ::-1]
        ends = np.stack((cells.min(axis=0), cells.max(axis=0) + 1))
        places = [points, free.low_m + free.cell_m * ends]
    free_cells = np.concatenate(places)
    low, high = free_cells.min(axis=0) - AROUND_M, free_cells.max(axis=0) + AROUND_M
    title = f"{scene.name}: {len(samples)} samples"
    ground_m = scene.bounds_m()[0][2]
    if free is not None:
        title = f"{scene.name}: {free.area_m2:.1f} m² free; {len(samples)} samples"
        ground_m = float(np.nanmedian(free.floor_m[free.is_free]))
    label_axes(axes, title, "x (m)", "y (m)")
    draw_scene_map(axes, scene, low, high, ground_m)
    if free is not None:
        extent_m = free.low_m + free.cell_m * np.array(free.is_free.shape[::-1])
        pixels = np.zeros((*free.is_free.shape, 4))
        pixels[free.is_free] = to_rgba(GREEN, 0.45)
        sides = (free.low_m[0], extent_m[0], free.low_m[1], extent_m[1])
        axes.imshow(pixels, extent=sides, origin="lower", interpolation="nearest", zorder=3)
    yaw = np.radians([sample.yaw_deg for sample in samples])
    axes.quiver(*points.T, np.cos(yaw), np.sin(yaw), color=BLUE, scale=45.0, width=0.003, zorder=5)
    axes.plot(*points.T, ".", color=BLUE, markersize=3, zorder=5)
    for placed in (placed for sample in samples for placed in sample.objects):
        shape = prepared.objects[placed.object]
        x, y = (placed.world_from_object @ (*shape.middle_m, 0.0, 1.0))[:2]
        axes.add_patch(Circle((x, y), shape.radius_m, fill=False, color=ORANGE, zorder=4))
    show_between(axes, low, high)
