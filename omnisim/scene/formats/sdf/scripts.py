"""OGRE material scripts of Gazebo Classic: colors and textures."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from omnisim.core.files.sources import read_source

Rgb = tuple[float, float, float]


class ScriptMaterial(NamedTuple):
    """First pass of a script material.

    Attributes:
        diffuse: linear RGB; None: not stated.
        alpha: opacity.
        emissive: linear RGB.
        texture: name of an image file; empty: no texture.
        is_known: True if these values describe the material completely.
    """

    diffuse: Rgb | None = None
    alpha: float = 1.0
    emissive: Rgb = (0.0, 0.0, 0.0)
    texture: str = ""
    is_known: bool = True


_GRAY: Rgb = (0.7, 0.7, 0.7)
# Materials of Gazebo's own script, which is not in a world's folder.
_COLORS: dict[str, Rgb] = {
    "Gray": _GRAY, "Grey": _GRAY, "DarkGray": (0.175,) * 3, "DarkGrey": (0.175,) * 3,
    "White": (1.0,) * 3, "FlatBlack": (0.1,) * 3, "Black": (0.0,) * 3, "Red": (1.0, 0.0, 0.0),
    "RedBright": (0.87, 0.26, 0.07), "Green": (0.0, 1.0, 0.0), "Blue": (0.0, 0.0, 1.0),
    "SkyBlue": (0.13, 0.44, 0.7), "Yellow": (1.0, 1.0, 0.0), "ZincYellow": (0.9725, 0.9529, 0.2078),
    "DarkYellow": (0.7, 0.7, 0.0), "Purple": (1.0, 0.0, 1.0), "Turquoise": (0.0, 1.0, 1.0),
    "Orange": (1.0, 0.5088, 0.0468), "Indigo": (0.33, 0.0, 0.5), "Gold": (0.8, 0.64869, 0.120759),
    "Pioneer2Body": (0.681193, 0.000923, 0.000923),
}  # fmt: skip
_GLOWS = ("White", "Red", "Green", "Blue", "Yellow", "Purple", "Turquoise")
_TRANSPARENT: dict[str, Rgb] = {
    "Red": (1.0, 0.0, 0.0), "Green": (0.0, 1.0, 0.0), "Blue": (0.0, 0.0, 1.0),
    "DarkMagenta": (0.6, 0.0, 0.6), "Grey": (0.5,) * 3, "Black": (0.0,) * 3,
    "Yellow": (1.0, 1.0, 0.0), "Orange": (1.0, 0.44, 0.0),
}  # fmt: skip
# Substitute colors for materials with Gazebo's own textures.
_TEXTURED: dict[str, Rgb] = {
    "Wood": (0.36, 0.2, 0.1), "WoodFloor": (0.4, 0.25, 0.13), "WoodPallet": (0.45, 0.32, 0.18),
    "CeilingTiled": (0.7,) * 3, "PaintedWall": (0.75, 0.73, 0.68), "Bricks": (0.35, 0.14, 0.1),
    "Road": (0.08,) * 3, "Residential": (0.1,) * 3, "Tertiary": (0.1,) * 3, "Motorway": (0.08,) * 3,
    "Trunk": (0.08,) * 3, "Primary": (0.08,) * 3, "Secondary": (0.08,) * 3, "Runway": (0.08,) * 3,
    "Pedestrian": (0.35,) * 3, "Footway": (0.35,) * 3, "Steps": (0.35,) * 3,
    "Grass": (0.1, 0.22, 0.05), "PioneerBody": (0.6, 0.02, 0.02), "BuildingFrame": (0.5,) * 3,
}  # fmt: skip


def _gazebo_materials() -> dict[str, ScriptMaterial]:
    materials = {name: ScriptMaterial(color) for name, color in _COLORS.items()}
    for name in _GLOWS:
        materials[f"{name}Glow"] = ScriptMaterial(_COLORS[name], emissive=_COLORS[name])
    for name, color in _TRANSPARENT.items():
        materials[f"{name}Transparent"] = ScriptMaterial(color, alpha=0.5)
    for name, color in _TEXTURED.items():
        materials[name] = ScriptMaterial(color, is_known=False)
    return {f"Gazebo/{name}": one for name, one in materials.items()}


GAZEBO_MATERIALS = _gazebo_materials()
_HEAD = re.compile(r"^\s*material\s+([^\s:{]+)(?:\s*:\s*([^\s{]+))?", re.MULTILINE)
_PASS = re.compile(r"\bpass\b[^{}]*\{")
_LINE = re.compile(r"(?:^|\{)[ \t]*(diffuse|ambient|emissive|texture)[ \t]+([^\n}]+)", re.MULTILINE)


def parse_scripts(text: str, parents: dict[str, ScriptMaterial]) -> dict[str, ScriptMaterial]:
    """Materials of a script by name, with the first colors and texture of each, or its parent's.

    Args:
        text: content of a `.material` file.
        parents: materials of other scripts, by name.
    """
    text = re.sub(r"//[^\n]*", "", text)
    heads = list(_HEAD.finditer(text))
    materials: dict[str, ScriptMaterial] = {}
    for head, end in zip(heads, [*(h.start() for h in heads), len(text)][1:], strict=True):
        parent = materials.get(head[2] or "") or parents.get(head[2] or "") or ScriptMaterial()
        values: dict[str, str] = {}
        passes = list(_PASS.finditer(text, head.end(), end))
        first_end = passes[1].start() if len(passes) > 1 else end
        for line in _LINE.finditer(text, head.end(), first_end):
            values.setdefault(line[1], line[2].strip())
        color = _numbers(values.get("diffuse", ""))
        emissive = _numbers(values.get("emissive", ""))
        materials[head[1]] = ScriptMaterial(
            _rgb(color) or parent.diffuse,
            min(max(color[3], 0.0), 1.0) if len(color) > 3 and color[3] > 0.0 else parent.alpha,
            _rgb(emissive) or parent.emissive,
            values["texture"].split()[0].strip('"') if "texture" in values else parent.texture,
        )
    return materials


def read_scripts(paths: list[Path]) -> dict[str, ScriptMaterial]:
    """Materials of all scripts among files and folders; unreadable files are skipped."""
    materials: dict[str, ScriptMaterial] = {}
    for path in paths:
        for file in sorted(path.glob("*.material")) if path.is_dir() else [path]:
            try:
                text = read_source(file).decode("utf-8", "replace")
            except OSError:  # the missing material is reported later
                continue
            materials |= parse_scripts(text, materials)
    return materials


def _numbers(text: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:  # the keyword vertexcolor
        return ()
    return values if all(0.0 <= value <= 1e6 for value in values) else ()


def _rgb(values: tuple[float, ...]) -> Rgb | None:
    return (values[0], values[1], values[2]) if len(values) >= 3 else None
