"""Figure of a frame's cost as scene, image and number of cameras grow, and of batches."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from benchmarks.figures import panels, plain_log
from omnisim.plots import style


def scaling_figure(report: dict[str, Any]) -> Figure:
    """Figure of the rows; bars extend from the median to the 95th percentile."""
    rows_of = {
        against: [row for row in report["rows"] if row["against"] == against]
        for against in ("triangles", "image", "cameras", "batch")
    }
    title = f"What a frame costs, {report['setting']}"
    figure, (town, pixels, cameras, *batches) = panels(report, title, 3 + bool(rows_of["batch"]))
    small = rows_of["triangles"][0]["image_px"]
    style.label_axes(town, f"A town, {small}²", "triangles in the scene", "ms a frame")
    _times(town, rows_of["triangles"], "triangles", "omnisim", style.BLUE)
    raced = [row for row in rows_of["triangles"] if "embree_ratio" in row]
    if raced:
        town.plot(
            [row["triangles"] for row in raced], [row["as_good_p50_ms"] for row in raced], "o:",
            color=style.BLUE, label="as good as a ray a pixel",
        )  # fmt: skip
        town.plot(
            [row["triangles"] for row in raced], [row["embree_p50_ms"] for row in raced], "s--",
            color=style.ORANGE, label="Embree's rays, one thread, no colors",
        )  # fmt: skip
        town.legend(frameon=False, fontsize=9)
    town.set_xscale("log")
    town.xaxis.set_major_formatter(EngFormatter(sep=" "))
    style.label_axes(pixels, f"One camera in {report['scene']}", "side of the image (px)", "")
    _times(pixels, rows_of["image"], "image_px", "omnisim", style.BLUE)
    plain_log(pixels.xaxis, base=2)
    style.label_axes(cameras, f"Cameras of {small}² in {report['scene']}", "cameras", "")
    counts = [row["cameras"] for row in rows_of["cameras"]]
    images = [row["cameras"] * row["fps"] for row in rows_of["cameras"]]
    cameras.plot(counts, images, "o-", color=style.GREEN)
    cameras.set_ylabel("images per second, of all cameras")
    cameras.set_ylim(0.0, 1.25 * max(images))
    plain_log(cameras.xaxis, base=2)
    for axes in batches:
        _batches(axes, rows_of["batch"])
    for axes in (town, pixels):
        plain_log(axes.yaxis)
    return figure


def _times(axes: Axes, rows: list[dict[str, Any]], key: str, label: str, color: str) -> None:
    above = [row["p95_ms"] - row["p50_ms"] for row in rows]
    axes.errorbar(
        [row[key] for row in rows], [row["p50_ms"] for row in rows], ([0.0] * len(rows), above),
        color=color, marker="o", capsize=2.5, label=label,
    )  # fmt: skip


def _batches(axes: Axes, rows: list[dict[str, Any]]) -> None:
    side_px = rows[0]["image_px"]
    style.label_axes(axes, f"Images of {side_px}²", "images at once", "images per second")
    counts = [row["cameras"] for row in rows]
    for key, label, line in (
        ("images_per_second", "in a batch", "o-"),
        ("single_images_per_second", "one after the other", "s--"),
    ):
        axes.plot(counts, [row[key] for row in rows], line, color=style.GREEN, label=label)
    axes.set_ylim(0.0)
    axes.legend(frameon=False, fontsize=9)
    plain_log(axes.xaxis, base=2)
