"""Figure of the race: frame time against quality."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.figures import panels, plain_log
from benchmarks.peers import field
from benchmarks.peers.quality import TRUTH
from omnisim.plots import style

OURS, THEIRS = style.BLUE, style.ORANGE
APART = 0.048  # labels, as a share of the panel's height
ROOM_DB = 2.0


def peers_figure(report: dict[str, Any]) -> Figure:
    """Figure with a panel per scene; a peer without an image is a line."""
    scenes = list(dict.fromkeys(row["scene"] for row in report["rows"]))
    title = f"The same frame, {report['image_px']}², by others' ways"
    figure, axes_of = panels(report, title, len(scenes), share_y=True)
    raced = [row for row in report["rows"] if row["missing"] is None]
    levels = [row["psnr_db"] for row in raced if row["psnr_db"] is not None]
    for axes, scene in zip(axes_of, scenes, strict=True):
        style.label_axes(axes, scene, "ms a frame (median), logarithmic", "")
        plain_log(axes.xaxis)
        rows = [row for row in raced if row["scene"] == scene]
        times = [row["p50_ms"] for row in rows]
        axes.set_xlim(0.7 * min(times), 3.5 * max(times))  # names stand right of their points
        axes.set_ylim(min(levels) - ROOM_DB, max(levels) + ROOM_DB)
        _draw(axes, rows)
    axes_of[0].set_ylabel("PSNR in dB against 64 samples a pixel")
    text = (
        "bars: the worst pose; line: ours by texels a pixel; "
        "hollow: another image, without lights or by pyrender's own"
    )
    figure.supxlabel(text, fontsize=8, color=style.GRAY)
    return figure


def _draw(axes: Axes, rows: list[dict[str, Any]]) -> None:
    ladder = [row for row in rows if row["racer"] in field.LADDER]
    text = [(row["p50_ms"], row["psnr_db"]) for row in ladder]
    axes.plot(*zip(*text, strict=True), ".-", color=OURS, linewidth=0.8, alpha=0.6)
    images = sorted(
        (row for row in rows if row["psnr_db"] is not None and row["racer"] not in field.BETWEEN),
        key=lambda row: row["psnr_db"],
    )
    heights = _apart(np.array([row["psnr_db"] for row in images]), axes.get_ylim())
    for row, height in zip(images, heights, strict=True):
        color = OURS if row["racer"].startswith("omnisim") else THEIRS
        point = (row["p50_ms"], row["psnr_db"])
        axes.plot([point[0]] * 2, [row["psnr_worst_db"], point[1]], color=color, linewidth=1.0)
        same = row["psnr_against"] == TRUTH
        axes.plot(*point, "o", color=color, markerfacecolor=color if same else "white")
        axes.annotate(
            row["racer"], point, (1.12 * point[0], height),
            fontsize=8, color=color, va="center",
            arrowprops={"arrowstyle": "-", "color": color, "linewidth": 0.4},
        )  # fmt: skip
    for row in rows:
        if row["psnr_db"] is None:
            axes.axvline(row["p50_ms"], color=THEIRS, linestyle=":")
            axes.text(
                1.03 * row["p50_ms"], 0.99, row["racer"], rotation=90, fontsize=8, color=THEIRS,
                transform=axes.get_xaxis_transform(), va="top",
            )  # fmt: skip


def _apart(levels: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Heights of labels for ascending levels (n,), with readable distances between neighbors."""
    step = APART * (limits[1] - limits[0])
    heights = levels.copy()
    for _ in range(100):  # each pair moves apart by half of the missing distance
        missing = np.maximum(step - np.diff(heights), 0.0)
        heights[1:] += 0.5 * missing
        heights[:-1] -= 0.5 * missing
    return heights
