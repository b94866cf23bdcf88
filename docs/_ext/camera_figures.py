"""Figures of the paper's camera, as SVG: a section through its mirror, and its frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from figure_style import AXIS_COLORS, line, path, svg, text
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL, RIG_FROM_OPTICAL_LOOKING_UP


def optics_figure() -> str:
    """A section through the mirror: heights up, although the mirror frame's z points down."""
    mirror = HyperbolicMirror()
    origin, px_per_m = np.array([300.0, 96.0]), 5200.0  # of the effective viewpoint, in the figure

    def at(points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        return origin + px_per_m * points_m * [1.0, -1.0]

    def toward(angle: float, radius_m: float) -> NDArray[np.float64]:
        return radius_m * np.array([np.sin(angle), -np.cos(angle)])

    def surface(angle: float) -> NDArray[np.float64]:
        return toward(abs(angle), float(mirror.rho_m(np.array(abs(angle))))) * [np.sign(angle), 1.0]

    viewpoint, pinhole = np.zeros(2), np.array([0.0, -mirror.c_m])
    section = np.linspace(-mirror.theta_max_rad, mirror.theta_max_rad, 121)
    parts = [
        line(at(np.array([[-0.045, 0.0], [0.06, 0.0]])), "dots"),
        line(at(np.array([viewpoint, pinhole])), "dots"),
    ]
    for degrees in (20, 45, 70, 90, 100):
        angle = np.radians(degrees)
        hit, far = surface(angle), toward(angle, 0.062)
        parts.append(line(at(np.array([far, hit])), "red tip"))
        parts.append(line(at(np.array([hit, pinhole])), "red"))
        parts.append(line(at(np.array([hit, viewpoint])), "dots"))
        x, y = at(toward(angle, 0.065))
        parts.append(text(x, y + 5, f"θ = {degrees}°", "red"))
    parts.append(line(at(np.array([surface(angle) for angle in section])), "blue"))
    parts += [_point(*at(viewpoint)), _point(*at(pinhole))]
    left = at(surface(-mirror.theta_max_rad))
    x, y = at(pinhole)
    parts += [
        text(left[0] - 4, left[1] + 52, "mirror: a hyperboloid", "blue", "end"),
        text(origin[0], origin[1] - 32, "effective viewpoint: the inner focus", "name", "middle"),
        path(f"M{origin[0]:g} {origin[1] - 26:g}V{origin[1] - 6:g}", "line"),
        text(x - 14, y - 4, "pinhole of the camera:", "name", "end"),
        text(x - 14, y + 13, "the outer focus", "name", "end"),
        text(
            x + 16, y + 5, f"c = {1e3 * mirror.c_m:.0f} mm below the effective viewpoint", "muted"
        ),
        text(20, origin[1] - 6, "horizon", "muted"),
    ]
    return svg("A section through the paper's mirror", 620, parts)


def frames_figure() -> str:
    """World and base, and the three frames at the effective viewpoint, beside it for clarity."""
    yaw = np.radians(25.0)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1.0]])
    base_m, viewpoint_m = np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.95])
    optical = turn @ RIG_FROM_OPTICAL_LOOKING_UP
    start = _px(viewpoint_m)
    parts = _vehicle(base_m, turn)
    parts += _frame(np.array([50.0, 420.0]), np.eye(3), "world", ("z up",), (0.0, 46.0))
    note = ("x forward, y left, z up", "on the ground")
    parts += _frame(_px(base_m), turn, "base", note, (0.0, 34.0))
    for row, (name, axes, note) in enumerate(
        (
            ("rig", turn, ("x forward, y left, z up",)),
            ("optical", optical, ("x right, y down,", "z forward, into the mirror")),
            ("mirror", optical @ MIRROR_FROM_OPTICAL.T, ("z toward the pinhole",)),
        )
    ):
        origin = np.array([480.0, 100.0 + 150.0 * row])
        parts.append(line(np.array([start, origin]), "dots"))
        parts += _frame(origin, axes, name, note, (86.0, -8.0))
    x, y = start
    parts += [
        _point(x, y),
        text(x, y - 42, "effective viewpoint", "name", "middle"),
        text(x - 44, y + 4, "mirror", "blue", "end"),
        text(x - 24, y + 76, "camera", "muted", "end"),
    ]
    return svg("Frames of a vehicle with the paper's camera", 496, parts)


_AZIMUTH, _ELEVATION = np.radians((-40.0, 22.0))  # from where the frames are seen
_RIGHT = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
_UP = np.array(
    [
        -np.cos(_AZIMUTH) * np.sin(_ELEVATION),
        -np.sin(_AZIMUTH) * np.sin(_ELEVATION),
        np.cos(_ELEVATION),
    ]
)
_BASE_PX, _PX_PER_M = np.array([250.0, 390.0]), 300.0


def _px(points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthographic projection of points relative to the base."""
    return _BASE_PX + _PX_PER_M * np.stack([points_m @ _RIGHT, -points_m @ _UP], axis=-1)


def _vehicle(base_m: NDArray[np.float64], turn: NDArray[np.float64]) -> list[str]:
    """Hull, wheels, mast, camera and mirror, as lines."""
    x, y, low, high = 0.25, 0.18, 0.08, 0.3
    corners = np.array([(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)])

    def ring(height: float) -> NDArray[np.float64]:
        return _px(base_m + np.column_stack([corners, np.full(5, height)]) @ turn.T)

    angles = np.linspace(0.0, 2.0 * np.pi, 41)
    circle = np.column_stack([np.cos(angles), np.zeros(41), np.sin(angles)])
    wheels = [
        _px(base_m + (0.09 * circle + [along, side, 0.09]) @ turn.T)
        for along in (-0.15, 0.15)
        for side in (-y, y)
    ]
    parts = [line(wheel) for wheel in wheels]
    parts += [line(ring(low)), line(ring(high))]
    parts += [
        line(np.array([bottom, top])) for bottom, top in zip(ring(low), ring(high), strict=True)
    ]
    level = circle[:, [0, 2, 1]]
    up = np.array([0.0, 0.0, 1.0])
    mirror = [_px(base_m + radius * level + height * up)
              for radius, height in ((0.1, 1.0), (0.08, 0.97), (0.05, 0.945))]  # fmt: skip
    parts += [line(ellipse, "blue") for ellipse in mirror]
    parts.append(line(_px(base_m + np.outer([high, 0.7], up))))
    parts.append(line(_px(base_m + 0.04 * level + 0.7 * up)))
    return parts


def _frame(
    origin: NDArray[np.float64],
    axes: NDArray[np.float64],
    name: str,
    note: tuple[str, ...],
    label_px: tuple[float, float],
) -> list[str]:
    """Three arrows of a frame, its name beside it and what its axes are."""
    parts = []
    for axis, color, letter in zip(axes.T, AXIS_COLORS, "xyz", strict=True):
        way = 62.0 * np.array([axis @ _RIGHT, -axis @ _UP])
        parts.append(line(np.array([origin, origin + way]), f"{color} tip"))
        x, y = origin + 1.16 * way
        parts.append(text(x, y + 4, letter, color, "middle"))
    x, y = origin + label_px
    notes = [text(x, y + 18 * row, words, "muted") for row, words in enumerate(note, 1)]
    return [*parts, text(x, y, name, "name"), *notes]


def _point(x: float, y: float) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" class="point"/>'
