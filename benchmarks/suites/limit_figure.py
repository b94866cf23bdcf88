"""Stacked bars of a frame's time by part, and of its lower bound."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnisim.plots import style

_COLORS = {
    "virtual_cameras": style.BLUE,
    "capture": style.ORANGE,
    "readback": style.GREEN,
    "around": style.GRAY,
}
_WORDS = {
    "virtual_cameras": "virtual cameras",
    "capture": "mirror pass and capture",
    "readback": "readback",
    "around": "Python around them",
}
# The parts of the limit are below the matching parts of the frame.
_LIMITS = {
    "texels": ("virtual_cameras", "texels"),
    "triangles": ("virtual_cameras", "triangles"),
    "lookups": ("capture", "lookups"),
    "readback": ("readback", None),
}
_THICK, _THIN = 0.42, 0.24


def limit_figure(report: dict[str, Any]) -> Figure:
    """Figure of the suite `limit`."""
    rows = [row for row in report["rows"] if row["kind"] == "frame"]
    figure, axes = style.plot(
        f"Where a frame of {report['image_px']}² goes, and the least it needs on this machine",
        "milliseconds", "", height_in=1.6 + 0.75 * len(rows),
    )  # fmt: skip
    for at, row in enumerate(rows):
        is_first = at == 0
        start = 0.0
        for part, color in _COLORS.items():
            label = _WORDS[part] if is_first else None
            width = row[f"{part}_ms"]
            axes.barh(at, width, _THICK, start, color=color, label=label)
            start += width
        axes.barh(
            at, min(row["small_faces_ms"], row["virtual_cameras_ms"]), _THICK,
            color=style.BLUE, edgecolor="white", hatch="////", linewidth=0.0,
            label="their triangles and calls" if is_first else None,
        )  # fmt: skip
        axes.annotate(
            f"{100.0 * row['share_of_limit']:.0f} % of the limit", (start, at),
            textcoords="offset points", xytext=(6, 0), va="center", fontsize=9,
            bbox={"fc": "white", "ec": "none", "pad": 1.0},
        )  # fmt: skip
        _draw_limit(axes, row, at + 0.5 * (_THICK + _THIN), is_first)
    axes.set_yticks(range(len(rows)), [f"{row['scene']}\n{row['setting']}" for row in rows])
    axes.set_ylim(len(rows) - 0.3, -0.45)
    axes.margins(x=0.16)
    figure.legend(*_sorted(axes), loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _sorted(axes: Axes) -> tuple[list[Any], list[str]]:
    """Legend handles and labels in drawing order, with lines last."""
    handles, labels = axes.get_legend_handles_labels()
    return [*handles[1:], handles[0]], [*labels[1:], labels[0]]


def _draw_limit(axes: Axes, row: dict[str, Any], at: float, is_first: bool) -> None:
    start = 0.0
    for name, (part, words) in _LIMITS.items():
        width = row[f"limit_{name}_ms"]
        hatch = "////" if name == "triangles" else None
        label = f"limit, {words}" if is_first and words else None
        axes.barh(
            at, width, _THIN, start, color=_COLORS[part], alpha=0.45, hatch=hatch,
            edgecolor="white", linewidth=0.0, label=label,
        )  # fmt: skip
        start += width
    axes.plot([start, start], [at - 0.5 * _THIN, at + 0.5 * _THIN], color=style.RED, linewidth=2.5,
              label="limit" if is_first else None)  # fmt: skip
