"""Vases, bottles, lenses and balls: closed bodies of thick glass, and chrome."""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import ball, lathe
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model

_SEGMENTS = 14


def _hollow(outer: list[tuple[float, float]], wall: float, floor: float) -> list:
    """Profile of a vessel: up its outside, and down its inside to a thick floor."""
    inner = [(max(r - wall, 0.004), max(z, floor)) for r, z in outer[1:]]
    kept = [inner[-1]]
    for r, z in inner[::-1][1:]:
        if z > floor or kept[-1][1] > floor:
            kept.append((r, z))
    return [(0.0, 0.0), *outer, *kept, (0.0, floor)]


def vase(a: Atlas, glass: str) -> Model:
    """Bellied vase, 0.34 m high."""
    outer = [(0.055, 0.0), (0.10, 0.07), (0.11, 0.13), (0.08, 0.21), (0.045, 0.27)]
    outer += [(0.05, 0.31), (0.075, 0.34)]
    return Model(f"vase_{glass}", glass, lathe(_hollow(outer, 0.010, 0.02), _SEGMENTS, 55))


def bottle(a: Atlas, glass: str) -> Model:
    """Bottle, 0.31 m high."""
    outer = [(0.040, 0.0), (0.040, 0.17), (0.030, 0.21), (0.015, 0.25), (0.016, 0.31)]
    return Model(f"bottle_{glass}", glass, lathe(_hollow(outer, 0.005, 0.012), 10, 55))


def bowl(a: Atlas, glass: str) -> Model:
    """Open bowl, 0.3 m wide."""
    outer = [(0.06, 0.0), (0.11, 0.03), (0.14, 0.08), (0.15, 0.12)]
    return Model(f"bowl_{glass}", glass, lathe(_hollow(outer, 0.012, 0.018), _SEGMENTS, 55))


def glass_ball(a: Atlas, glass: str) -> Model:
    """Solid ball of unit radius about the origin."""
    return Model(f"ball_{glass}", glass, ball(1.0, 20, 36))


def lens(a: Atlas, glass: str) -> Model:
    """Lens of 0.36 m that stands on its edge and faces -y, its middle at the origin."""
    radius, half, turns = 0.18, 0.035, np.linspace(0, 1, 4)
    curve = (radius**2 + half**2) / (2 * half)
    reach = np.arcsin(radius / curve)
    front = [(curve * np.sin(t * reach), curve * (1 - np.cos(t * reach)) - half) for t in turns]
    back = [(r, -z) for r, z in front[::-1]]
    profile = [(float(r), float(z) - 0.004 * (z < 0) + 0.004 * (z > 0)) for r, z in front]
    profile[-1] = (radius, -0.004)
    rear = [(float(r), float(z) + 0.004) for r, z in back]
    rear[0] = (radius, 0.004)
    patch = lathe([*profile, *rear], 24, 55)
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    return Model(f"lens_{glass}", glass, patch.moved(turn))


def chrome_ball(a: Atlas) -> Model:
    """Polished ball of unit radius about the origin."""
    return Model("chrome_ball", "chrome", ball(1.0, 14, 26))
