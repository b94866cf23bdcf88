"""Views of lamps: axes and matrices of their shadow maps.

Positions are relative to an anchor, in world axes. Depth is reversed, as for the virtual cameras:
1 is near the lamp. A map's x and y are two axes of its view, in either handedness, because both
sides of all surfaces cast shadows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import LAMP_NEAR_M, Light, LightKind

# Axes of cube faces as rows of x, y and forward: +z, +x, +y, then the opposite faces.
_CUBE_AXES = np.eye(3)[[[0, 1, 2], [1, 2, 0], [2, 0, 1]] * 2]
_CUBE_AXES[3:, 2] *= -1.0
_MAX_SPOT_RAD = math.radians(62.0)  # a cube resolves wider spots better
_SPOT_MARGIN = 1.02
_GUTTER_PX = 3.0  # beyond the 90° of a face, because lookups are offset from the surface


class PunctualView(NamedTuple):
    """Views of a point or spot light.

    Attributes:
        axes: (faces, 3, 3), rows x, y and forward; one face, or the six of a cube.
        tangent: tangent of half of each face's field of view.
    """

    axes: NDArray[np.float64]
    tangent: float


def is_cube(light: Light) -> bool:
    """Tell whether a light needs a whole cube, as point lights and wide spots do."""
    is_wide = math.acos(light.cone_cosines[1]) > _MAX_SPOT_RAD
    return light.kind is LightKind.POINT or (light.kind is LightKind.SPOT and is_wide)


def punctual_view(light: Light, size_px: int) -> PunctualView:
    """Views of a point or spot light, for maps of `size_px` × `size_px` texels."""
    if is_cube(light):
        return PunctualView(_CUBE_AXES, size_px / (size_px - 2.0 * _GUTTER_PX))
    tangent = math.tan(math.acos(light.cone_cosines[1]))
    return PunctualView(light_axes(light.direction)[None], _SPOT_MARGIN * tangent)


def light_axes(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Axes (3, 3), rows x, y and forward, of a view along a unit direction (3,)."""
    helper = np.eye(3)[0 if abs(direction[2]) > 0.9 else 2]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    return np.stack((x, np.cross(direction, x), direction))


def perspective_clips(view: PunctualView, position_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrices (faces, 4, 4) clip_from_anchor of views from a position (3,)."""
    projection = np.zeros((4, 3))
    projection[0, 0] = projection[1, 1] = 1.0 / view.tangent
    projection[3, 2] = 1.0
    clips = np.zeros((len(view.axes), 4, 4))
    clips[:, :, :3] = projection @ view.axes
    clips[:, :, 3] = -clips[:, :, :3] @ position_m
    clips[:, 2, 3] = LAMP_NEAR_M
    return clips


def orthographic_clip(
    axes: NDArray[np.float64],
    middle_m: NDArray[np.float64],
    half_m: float,
    depths_m: tuple[float, float],
) -> NDArray[np.float64]:
    """Matrix (4, 4) clip_from_anchor of a parallel view.

    Args:
        axes: (3, 3), rows x, y and forward.
        middle_m: (2,) center of the map along x and y.
        half_m: half the map's width.
        depths_m: minimum and maximum z along the axes.
    """
    near_m, far_m = depths_m
    clip = np.eye(4)
    clip[:3, :3] = axes / np.array([half_m, half_m, near_m - far_m])[:, None]
    clip[:3, 3] = *(-middle_m / half_m), far_m / (far_m - near_m)
    return clip
