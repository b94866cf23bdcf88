"""Counterpart of the paper's Fig. 10: frames per second against the mirror's polygons."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.figures import panels, plain_log
from omnisim.plots import style

EXACT_AT = 2**14  # where the exact mirror stands on the axis of polygons
COLORS = {"fast": style.BLUE, "default": style.ORANGE}
MARKERS = {360: "o", 1024: "s"}
LEVELS = {"no sensor": (style.GRAY, "-"), "lms200": (style.GREEN, "--")}
NAMES = {"no sensor": "view alone, no sensor", "lms200": "view and LMS200"}


def fps_figure(report: dict[str, Any]) -> Figure:
    """Figure with a panel per map; bars are 95 % confidence intervals of the median."""
    rows = report["rows"]
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure, axes_of = panels(report, "What the simulated camera costs", len(scenes), share_y=True)
    for axes, scene in zip(axes_of, scenes, strict=True):
        style.label_axes(axes, scene, "polygons of the mirror's mesh", "")
        _draw(axes, [row for row in rows if row["scene"] == scene])
    axes_of[0].set_ylabel("frames per second")
    handles, labels = axes_of[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def _draw(axes: Axes, rows: list[dict[str, Any]]) -> None:
    first = (rows[0]["size_px"], rows[0]["setting"])  # whose rounds give the levels
    for row in rows:
        if row["sensor"] in LEVELS and (row["size_px"], row["setting"]) == first:
            color, line = LEVELS[row["sensor"]]
            axes.axhline(row["fps"], color=color, linestyle=line, label=NAMES[row["sensor"]])
            axes.axhspan(row["fps_low"], row["fps_high"], color=color, alpha=0.12, linewidth=0)
    for size_px, setting in dict.fromkeys((row["size_px"], row["setting"]) for row in rows):
        camera = [
            row
            for row in rows
            if row["sensor"] == "camera" and (row["size_px"], row["setting"]) == (size_px, setting)
        ]
        meshes = [row for row in camera if row["polygons"] != "exact"]
        exact = [row for row in camera if row["polygons"] == "exact"]
        for found, line, label in (
            (meshes, "-", f"view and camera, {size_px}² {setting}"),
            (exact, "none", None),
        ):
            polygons = [row["polygons"] if found is meshes else EXACT_AT for row in found]
            axes.errorbar(
                polygons, *_fps(found), linestyle=line, label=label,
                color=COLORS[setting], marker=MARKERS.get(size_px, "^"), capsize=2.5,
            )  # fmt: skip
    axes.set_xscale("log", base=2)
    counts = sorted({row["polygons"] for row in rows if isinstance(row["polygons"], int)})
    axes.set_xticks([*counts, EXACT_AT], [*map(str, counts), "exact"])
    plain_log(axes.yaxis)


def _fps(rows: list[dict[str, Any]]) -> tuple[list[float], tuple[list[float], list[float]]]:
    """Medians, and the lengths of their intervals below and above."""
    below = [row["fps"] - row["fps_low"] for row in rows]
    above = [row["fps_high"] - row["fps"] for row in rows]
    return [row["fps"] for row in rows], (below, above)
