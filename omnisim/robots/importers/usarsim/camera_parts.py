"""Omnidirectional cameras in USARBot.ini: one part, or the paper's three groups (section 2.4).

The groups are the mirror, the virtual cameras at the effective viewpoint, and the camera that
looks up at the mirror from below. The Position of a whole camera or a mirror is assumed to be the
effective viewpoint as well.
"""

from __future__ import annotations

import math
import re

from omnisim.robots.importers.imported_robot import ImportedSensor
from omnisim.robots.importers.usarsim.usarsim_parts import Part

_MIRROR = re.compile(r"mirror")
_VIRTUAL = re.compile(r"cameratexture|virtualcam")
_OMNI = re.compile(r"omni.*cam|omnidirectional|catadioptric")
# The parts of a camera coincide; the lens is below, within the length of any mirror's mount.
SAME_PLACE_M = 1e-3
BESIDE_AXIS_M = 0.01
LENS_BELOW_M = 0.5
_FILE = 'file = "omnicam.toml"  # a sensor file; without one: the paper\'s camera'
LOOKS_UP = 0.9998  # cosine of 1°


def find_cameras(parts: list[Part]) -> list[tuple[ImportedSensor, list[Part]]]:
    """Find the omnidirectional cameras of a robot, and the parts of each camera."""
    cameras = []
    for group in _groups(parts):
        lens = _find_lens(group, parts)
        members = [*group, *([lens] if lens else [])]
        cameras.append((_camera(group[0], members), members))
    return cameras


def _groups(parts: list[Part]) -> list[list[Part]]:
    """Group omnidirectional cameras' parts by position; each group starts with its lead part."""
    groups: list[list[Part]] = []
    for part in parts:
        if _rank(part) is None:
            continue
        near = (g for g in groups if math.dist(g[0].position_m, part.position_m) <= SAME_PLACE_M)
        group = next(near, None)
        if group is None:
            groups.append([part])
        else:
            group.append(part)
    return [sorted(group, key=lambda part: _rank(part) or 0) for group in groups]


def _rank(part: Part) -> int | None:
    """Rank of a part: 0 whole camera, 1 mirror, 2 virtual camera, None any other part."""
    for rank, pattern in ((1, _MIRROR), (2, _VIRTUAL), (0, _OMNI)):
        if pattern.search(part.short_class):
            return rank
    return None


def _find_lens(group: list[Part], parts: list[Part]) -> Part | None:
    """Find the camera that looks up at the mirror from below."""
    x, y, z = group[0].position_m
    for part in parts:
        px, py, pz = part.position_m
        if (
            _rank(part) is None
            and "camera" in part.short_class
            and math.hypot(px - x, py - y) <= BESIDE_AXIS_M
            and 0.0 <= z - pz <= LENS_BELOW_M
            and part.forward[2] >= LOOKS_UP
        ):
            return part
    return None


def _camera(lead: Part, members: list[Part]) -> ImportedSensor:
    return ImportedSensor(
        name=lead.name,
        type="omnicamera",
        position_m=lead.position_m,
        # virtual cameras look in all directions
        angles_deg=(0.0, 0.0, 0.0) if _rank(lead) == 2 else lead.angles_deg,
        comments=(*(f"line {part.entry.line}: {part}" for part in members), _FILE),
    )
