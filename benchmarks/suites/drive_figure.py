"""Frame times over a drive, with those of the constant workload below."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from omnisim.plots import style

_MAX_RATIO = 4.0  # upper limit of the axis, as a multiple of the median


def drive_figure(report: dict[str, Any]) -> Figure:
    """Figure of the suite `drive`."""
    rows = [row for row in report["rows"] if row["kind"] == "frames"]
    figure = Figure(figsize=(8.0, 3.4 * len(rows)), dpi=style.DPI, layout="constrained")
    grid = figure.add_gridspec(2 * len(rows), 1, height_ratios=[3, 1.2] * len(rows))
    for at, row in enumerate(rows):
        series = {
            name: np.array(values) for name, values in report["series"][row["setting"]].items()
        }
        axes = figure.add_subplot(grid[2 * at])
        style.label_axes(
            axes,
            f"{report['robot']} in {report['scene']}, {row['setting']}: "
            f"{row['rounds']} frames, p99/p50 = {row['p99_to_p50']:.2f}",
            "", "frame (ms)",
        )  # fmt: skip
        axes.plot(series["frame"], color=style.BLUE, linewidth=0.8)
        for percent, color, side in (
            (50, style.GREEN, "center"), (95, style.ORANGE, "top"), (99, style.RED, "bottom")
        ):  # fmt: skip
            value = row[f"p{percent}_ms"]
            axes.axhline(value, color=color, linewidth=1.2, linestyle="--", zorder=1)
            axes.annotate(
                f"p{percent}", (1.0, value), xycoords=("axes fraction", "data"),
                textcoords="offset points", xytext=(3, 0), va=side, fontsize=8, color=color,
            )  # fmt: skip
        collected = np.flatnonzero(series["collector"])
        axes.plot(
            collected, series["frame"][collected], "v", color=style.GRAY, markersize=4,
            label="the collector ran",
        )  # fmt: skip
        axes.set_ylim(bottom=0.0)
        axes.tick_params(labelbottom=False)
        if collected.size:
            axes.legend(frameon=False, fontsize=8, loc="lower left")
        below = figure.add_subplot(grid[2 * at + 1], sharex=axes)
        style.label_axes(below, "", "frame", "× median")
        for name, label, color in (
            ("all threads", "constant work, all threads", style.ORANGE),
            ("one thread", "one thread", style.GRAY),
            ("processor", "the frame's processor time", style.BLUE),
        ):
            values = series[name]
            below.plot(values / np.median(values), color=color, linewidth=0.8, label=label)
        below.set_ylim(0.0, _MAX_RATIO)
        below.legend(framealpha=0.85, edgecolor="none", fontsize=8, ncols=3, loc="upper left")
    return figure
