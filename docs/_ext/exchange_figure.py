"""Figure of the formats that omnisim reads and writes, as SVG from the code's registries."""

from __future__ import annotations

import textwrap

from figure_style import box, path, svg, text
from omnisim.cameras.calibration import FORMATS as CALIBRATIONS
from omnisim.datasets.export.export_formats import FORMATS as EXPORTS
from omnisim.datasets.export.export_formats import LAYOUTS

# Suffixes of worlds; trimesh reads more of them.
WORLDS = (
    *(".glb", ".gltf", ".obj", ".ply", ".stl", ".dae", ".usd", ".usda", ".usdz"),
    *(".xml", ".urdf", ".sdf", ".world"),
)
_WIDTH_PX, _LINE_PX = 270, 18


def exchange_figure() -> str:
    """The figure as SVG."""
    upper, lower = (
        _LINE_PX * max(len(_lines(names)) for names in row) + 40
        for row in ((WORLDS, tuple(EXPORTS)), (tuple(CALIBRATIONS), tuple(LAYOUTS)))
    )
    top = 22 + upper
    end = top + lower // 2
    parts = [
        _formats(10, 10, upper, "Worlds and robots", WORLDS),
        _formats(10, top, lower, "Calibrations", tuple(CALIBRATIONS)),
        box(316, 92, 108, 60),
        text(370, 127, "omnisim", "code", "middle"),
        _formats(460, 10, upper, "Runs", tuple(EXPORTS)),
        _formats(460, top, lower, "Data sets", tuple(LAYOUTS)),
        path("M280 63H298V112H314"),
        path(f"M314 140H298V{end}H282"),
        path(f"M298 {end}V140H314"),
        path("M424 112H442V63H458"),
        path(f"M424 140H442V{end}H458"),
    ]
    return svg("Formats that omnisim reads and writes", top + lower + 10, parts)


def _lines(names: tuple[str, ...]) -> list[str]:
    return textwrap.wrap("  ".join(names), 38, break_on_hyphens=False)


def _formats(left: int, top: int, height: int, title: str, names: tuple[str, ...]) -> str:
    labels = [
        text(left + 12, top + 44 + _LINE_PX * row, words, "call")
        for row, words in enumerate(_lines(names))
    ]
    return "\n".join(
        (box(left, top, _WIDTH_PX, height), text(left + 12, top + 23, title, "name"), *labels)
    )
