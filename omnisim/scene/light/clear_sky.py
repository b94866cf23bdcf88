"""Radiance of a clear sky.

Source: Preetham, Shirley and Smits, "A practical analytic model for daylight", 1999, appendix A.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.light.environment import map_directions

ROWS = 256
MIN_SUN_ELEVATION_DEG = 2.0  # the model is undefined nearer to the horizon
GROUND_REFLECTANCE = 0.2
# Perez coefficients A to E of luminance Y and of chromaticities x and y: linear in turbidity
# (factor, constant).
_PEREZ = np.array(
    [
        [(0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771),
         (-0.0670, 0.3703)],
        [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989),
         (-0.0033, 0.0452)],
        [(-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537),
         (-0.0109, 0.0529)],
    ]
)  # fmt: skip
# Zenith chromaticities x and y: powers of turbidity by powers of the sun's zenith angle.
_ZENITH = np.array(
    [
        [(0.00166, -0.00375, 0.00209, 0.0), (-0.02903, 0.06377, -0.03202, 0.00394),
         (0.11693, -0.21196, 0.06052, 0.25886)],
        [(0.00275, -0.00610, 0.00317, 0.0), (-0.04214, 0.08970, -0.04153, 0.00516),
         (0.15346, -0.26756, 0.06670, 0.26688)],
    ]
)  # fmt: skip
_RGB_FROM_XYZ = np.array(  # sRGB, IEC 61966-2-1
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


def clear_sky(toward_sun: NDArray[np.float64], turbidity: float) -> NDArray[np.float32]:
    """Environment map (height, width, 3) of a clear sky without the sun's disc, linear RGB, cd/m².

    Below the horizon, a gray ground reflects the light of that sky.

    Args:
        toward_sun: (3,) unit vector, world frame; a low sun is raised to `MIN_SUN_ELEVATION_DEG`.
        turbidity: atmospheric turbidity: 2 very clear, 6 hazy.
    """
    directions, angles = map_directions(ROWS, 2 * ROWS)
    toward_sun = _raised(toward_sun)
    height = directions[: ROWS // 2, :, 2]
    between = np.arccos(np.clip(directions[: ROWS // 2] @ toward_sun, -1.0, 1.0))
    sun_angle = np.arccos(toward_sun[2])
    coefficients = _PEREZ @ (turbidity, 1.0)
    values = [
        zenith * _perez(one, height, between) / _perez(one, np.float64(1.0), sun_angle)
        for zenith, one in zip(_zenith(sun_angle, turbidity), coefficients, strict=True)
    ]
    rgb = np.maximum(_rgb(*values), 0.0)
    weights = (angles[: ROWS // 2, None] * height)[..., None]
    ground = GROUND_REFLECTANCE / np.pi * (rgb * weights).sum(axis=(0, 1))
    return np.concatenate((rgb, np.broadcast_to(ground, rgb.shape))).astype(np.float32)


def sun_illuminance(toward_sun: NDArray[np.float64], turbidity: float) -> NDArray[np.float64]:
    """Illuminance (3,) of the sun on a surface that faces it, linear RGB, lx.

    It is the extraterrestrial illuminance, attenuated along the air mass by molecules and haze.

    Source: Preetham, Shirley and Smits, appendix A.1 (Rayleigh, and Ångström's aerosol, at the
    primaries' wavelengths); Kasten and Young, 1989 (relative air mass).
    """
    elevation_deg = np.degrees(np.arcsin(_raised(toward_sun)[2]))
    mass = 1.0 / (
        np.sin(np.radians(elevation_deg)) + 0.50572 * (elevation_deg + 6.07995) ** -1.6364
    )
    wavelengths_um = np.array([0.610, 0.550, 0.465])
    haze = 0.04608 * turbidity - 0.04586
    depth = 0.008735 * wavelengths_um**-4.08 + haze * wavelengths_um**-1.3
    light: NDArray[np.float64] = 128_000.0 * np.exp(-mass * depth)
    return light


def _raised(toward_sun: NDArray[np.float64]) -> NDArray[np.float64]:
    lowest = np.sin(np.radians(MIN_SUN_ELEVATION_DEG))
    if toward_sun[2] >= lowest:
        return toward_sun
    level = toward_sun[:2] / max(float(np.hypot(*toward_sun[:2])), 1e-12)
    return np.array([*level * np.sqrt(1.0 - lowest**2), lowest])


def _perez(
    coefficients: NDArray[np.float64],
    height: NDArray[np.float64] | np.float64,
    between: NDArray[np.float64] | np.float64,
) -> NDArray[np.float64]:
    a, b, c, d, e = coefficients
    shape: NDArray[np.float64] = (1.0 + a * np.exp(b / np.maximum(height, 0.01))) * (
        1.0 + c * np.exp(d * between) + e * np.cos(between) ** 2
    )
    return shape


def _zenith(sun_angle: float, turbidity: float) -> tuple[float, float, float]:
    """Luminance, cd/m², and chromaticities x and y of the zenith."""
    spread = (4.0 / 9.0 - turbidity / 120.0) * (np.pi - 2.0 * sun_angle)
    luminance = (4.0453 * turbidity - 4.9710) * np.tan(spread) - 0.2155 * turbidity + 2.4192
    x, y = np.array([turbidity**2, turbidity, 1.0]) @ _ZENITH @ sun_angle ** np.arange(3, -1, -1)
    return 1000.0 * max(float(luminance), 0.0), float(x), float(y)


def _rgb(
    luminance: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    xyz = np.stack((x / y * luminance, luminance, (1.0 - x - y) / y * luminance), axis=-1)
    rgb: NDArray[np.float64] = xyz @ _RGB_FROM_XYZ.T
    return rgb
