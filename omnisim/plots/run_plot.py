"""Plot of a run from above: map, path, dead reckoning, landmarks, and a strip of its images."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.trajectories import Trajectory
from omnisim.plots.scene_plot import INK, draw_landmark, draw_scene_map
from omnisim.plots.style import show_between
from omnisim.scene import Scene

TRUE, RECKONED = "#1f5fa8", "#d9622b"
RUNS = (TRUE, "#b03060", "#2b8a57", "#7a3fa0")
STRIP = 6  # number of images
STRIP_IN = 3.0  # maximum height
OTHERS = ("#7a3fa0", "#2b8a57", "#b03060", "#8a6d1f")
TITLE_LETTERS = 110  # per line


@dataclass(frozen=True, eq=False)
class RunDrawing:
    """Drawn run of one robot."""

    truth: Trajectory  # poses of the base
    reckoned: Floats | None  # (n, 2) positions by dead reckoning; None: no odometry
    images: Mapping[int, Bytes]  # some images (height, width, 3), by step
    name: str = ""  # name of the robot, if there are several


def run_figure(
    title: str,
    scene: Scene | None,
    runs: Sequence[RunDrawing],
    others: Mapping[str, Trajectory] | None = None,
) -> Figure:
    """Plot of a run, or of the runs of robots that drove together.

    Args:
        title: title of one or more lines; long lines are wrapped.
        scene: scene for map and landmarks; None: no map.
        runs: one run or more.
        others: poses of other robots and of dynamic objects, by name.
    """
    low, high = _extent(runs, scene)
    size = high - low
    width_in = 9.0
    # width without labels, for axes of equal scale
    map_in = float(np.clip((width_in - 0.8) * size[1] / size[0], 3.5, 12.0))
    strips = [run for run in runs if run.images]
    strips_in = [min(width_in / len(run.images), STRIP_IN) for run in strips]
    size_in = width_in, map_in + sum(strips_in) + 1.1
    figure = Figure(figsize=size_in, dpi=110, layout="constrained")
    grid = figure.add_gridspec(1 + len(strips), 1, height_ratios=[map_in, *strips_in])
    axes = figure.add_subplot(grid[0])
    lines = (textwrap.fill(line, TITLE_LETTERS) for line in title.splitlines())
    axes.set_title("\n".join(lines), fontsize=10, parse_math=False)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    if scene is not None:
        heights_m = np.concatenate([run.truth.positions_m[:, 2] for run in runs])
        draw_scene_map(axes, scene, low, high, float(np.median(heights_m)))
        for landmark in scene.landmarks:
            draw_landmark(axes, landmark)
    for k, (name, other) in enumerate((others or {}).items()):
        color = OTHERS[k % len(OTHERS)]
        axes.plot(*other.positions_m[:, :2].T, "o", color=color, ms=4, label=name, zorder=4)
    for run, color in zip(runs, itertools.cycle(RUNS), strict=False):
        _draw_run(axes, run, color)
    show_between(axes, low, high)
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    for row, run in enumerate(strips, start=1):
        columns = grid[row].subgridspec(1, len(run.images))
        prefix = f"{run.name}, " if run.name else ""
        for column, (step, image) in enumerate(run.images.items()):
            strip = figure.add_subplot(columns[column])
            strip.set_axis_off()
            strip.set_title(f"{prefix}step {step}, {run.truth.times_s[step]:.1f} s", fontsize=8)
            strip.imshow(image)
    return figure


def _draw_run(axes: Axes, run: RunDrawing, color: str) -> None:
    truth, prefix = run.truth, f"{run.name}: " if run.name else ""
    x, y = truth.positions_m[:, 0], truth.positions_m[:, 1]
    if run.reckoned is not None:
        reckoned_color = color if run.name else RECKONED
        axes.plot(*run.reckoned.T, "--", color=reckoned_color, lw=1.6, label=f"{prefix}odometry")
    axes.plot(x, y, "-", color=color, lw=2.2, label=f"{prefix}true path")
    label = None if run.name else "start"
    axes.plot(x[0], y[0], "o", color=color, markersize=9, markerfacecolor="white", label=label)
    yaw = truth.yaw_rad
    every = max(1, len(x) // 24)
    axes.quiver(
        x[::every], y[::every], np.cos(yaw[::every]), np.sin(yaw[::every]),
        color=color, scale=36.0, width=0.003, zorder=3,
    )  # fmt: skip
    by_position: dict[tuple[float, float], list[int]] = {}  # to a centimeter
    for step in run.images:
        u, v = truth.positions_m[step, :2].round(2).tolist()
        by_position.setdefault((u, v), []).append(step)
    for position, steps in by_position.items():
        axes.annotate(
            ", ".join(map(str, steps)), position, textcoords="offset points", xytext=(7, 7),
            fontsize=9, color=INK,
            bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": color, "lw": 0.8},
        )  # fmt: skip


def steps_to_show(steps: int) -> list[int]:
    """Steps evenly spread over a run, including its first and last."""
    return sorted({round(k) for k in np.linspace(0, steps - 1, min(STRIP, steps))})


def _extent(runs: Sequence[RunDrawing], scene: Scene | None) -> tuple[Floats, Floats]:
    """Corners (2,) of the map: the paths with a margin, and landmarks near them."""
    places = [run.truth.positions_m[:, :2] for run in runs]
    places += [run.reckoned for run in runs if run.reckoned is not None]
    positions = np.concatenate(places)
    low, high = positions.min(axis=0), positions.max(axis=0)
    room = max(1.5, 0.25 * float((high - low).max()))
    low, high = low - room, high + room
    for landmark in scene.landmarks if scene is not None else ():
        position = np.array(landmark.position_m[:2])
        if np.all(position > low - room) and np.all(position < high + room):
            # half of the width of a name and of the marker
            margin = max(0.5, 0.08 * float(high[0] - low[0]))
            low, high = np.minimum(low, position - margin), np.maximum(high, position + margin)
    return low, high
