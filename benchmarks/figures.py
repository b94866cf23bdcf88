"""Figures with several panels, headed by the machine of the measurement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator, StrMethodFormatter

from omnisim.plots import style
from omnisim.report.machine import machine_line

PANEL_IN, HEIGHT_IN, NARROWEST_IN = 4.9, 5.6, 7.0
SECOND_LINE_IN = 0.42  # from the figure's top


def panels(
    report: dict[str, Any], title: str, count: int, share_y: bool = False
) -> tuple[Figure, Sequence[Axes]]:
    """Figure with panels side by side; a line above names the machine."""
    size = (max(NARROWEST_IN, PANEL_IN * count), HEIGHT_IN)
    figure = Figure(figsize=size, dpi=style.DPI, layout="constrained")
    axes = figure.subplots(1, count, sharey=share_y, squeeze=False)[0]
    figure.suptitle(f"{title}\n", fontsize=style.TITLE_PT)  # the second line is the machine's
    second_line = 1.0 - SECOND_LINE_IN / HEIGHT_IN
    figure.text(
        0.5, second_line, machine_line(report["machine"]),
        ha="center", va="center", fontsize=7.5, color=style.GRAY,
    )  # fmt: skip
    return figure, axes


def plain_log(axis: Axis, base: int = 10) -> None:
    """Set a logarithmic axis with plain numbers instead of powers."""
    set_scale = axis.axes.set_xscale if isinstance(axis, XAxis) else axis.axes.set_yscale
    set_scale("log")
    steps = (1.0, 2.0, 5.0) if base == 10 else (1.0,)
    axis.set_major_locator(LogLocator(base, steps))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())
    if base != 10:
        axis.set_minor_locator(NullLocator())
