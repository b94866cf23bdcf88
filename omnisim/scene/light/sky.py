"""Sky of a scene: an environment map from a file, or a clear sky, with the table's brightness."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import OutputError, SceneError
from omnisim.core.files.image_files import read_radiance
from omnisim.core.files.sources import SourceReader
from omnisim.core.files.toml_file import find_beside
from omnisim.scene.light.environment import Environment, map_directions
from omnisim.scene.light.light_tables import LightTable, SkyTable, SunTable
from omnisim.scene.light.lighting import is_even
from omnisim.scene.model import Light, Lighting, LightKind, Scene

MAX_ROWS = 4096
SUFFIXES = ".hdr", ".exr"
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # weights of linear sRGB, Rec. 709
_UP = np.array([[0.0, 0.0, 1.0]])


def with_sky(
    scene: Scene,
    sky: SkyTable,
    light: LightTable,
    sun: SunTable | None,
    toml: str,
    folder: Path,
    reader: SourceReader,
) -> Scene:
    """Scene with a sky in place of even light, by the tables of its TOML file; its lamps stay on.

    `toml` is the path of that file, for messages, and `folder` the base of a map's path.

    Raises:
        SceneError: a map that cannot be read or is invalid, or a clear sky at night.
    """
    before = scene.lighting
    lighting = replace(
        before,
        ambient=light.ambient or (0.0, 0.0, 0.0),
        lights=() if is_even(before) else before.lights,
        baked=None,
    )
    if sky.file is not None:
        path = find_beside(folder, sky.file, f"{toml}: sky.file", SceneError)
        radiance = _read_map(reader.note(path))
        # by whole columns, counter-clockwise seen from above
        radiance = np.roll(radiance, round(-sky.yaw_deg / 360.0 * radiance.shape[1]), axis=1)
        lighting = _with_map(lighting, radiance, sky.brightness)
    elif sun is not None:
        lighting = _around_sun(lighting, sky, sun, light, toml)
    else:
        lighting = _with_own_sun(lighting, sky, light)
    return replace(scene, lighting=lighting)


def _with_map(
    lighting: Lighting, radiance: Floats32, brightness: float, sun: float = 0.0
) -> Lighting:
    """Lighting with a map, scaled to a brightness of a level white surface under map and sun.

    `sun` is the luminance of that surface under the sun alone, in the map's unit.
    """
    level = sun + _level_luminance(radiance)
    scale = brightness / level if level > 0.0 else 1.0
    return replace(lighting, environment=Environment(radiance).scaled(scale))


def _with_own_sun(lighting: Lighting, table: SkyTable, light_table: LightTable) -> Lighting:
    """Lighting with a clear sky and its sun, at the table's brightness.

    Without other lamps, the exposure is that of the sun in lux.
    """
    azimuth = math.radians(table.sun_azimuth_deg)
    elevation = math.radians(table.sun_elevation_deg)
    across = math.cos(elevation)
    toward_sun = np.array(
        [across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)]
    )
    radiance = clear_sky(toward_sun, table.turbidity)
    light = sun_illuminance(toward_sun, table.turbidity)
    level = float(_LUMINANCE @ light) * toward_sun[2] / math.pi
    lit = _with_map(lighting, radiance, table.brightness, level)
    scale = table.brightness / (level + _level_luminance(radiance))
    if not lit.lights and light_table.exposure is None:
        lit = replace(lit, exposure=scale / math.pi)
    red, green, blue = light / light.max()
    sun = Light(
        LightKind.DIRECTIONAL,
        (red, green, blue),
        float(light.max()) * scale / (math.pi * lit.exposure),
        direction=-toward_sun,
        casts_shadow=light_table.shadows is not False,
    )
    return replace(lit, lights=(*lit.lights, sun))


def _around_sun(
    lighting: Lighting, table: SkyTable, sun: SunTable, light: LightTable, toml: str
) -> Lighting:
    """Lighting with a clear sky around a sun in lux; sky, sun and lamps share one exposure."""
    position = sun_position(sun.time, sun.latitude_deg, sun.longitude_deg)
    if position.elevation_deg <= 0.0:
        raise SceneError(f"{toml}: sky: expected a sun above the horizon, or an environment map")
    toward_sun = -position.direction(sun.north_deg)
    radiance = clear_sky(toward_sun, table.turbidity)
    illuminance_lx = sun.illuminance_lx or sun_illuminance_lx(position.elevation_deg)
    level_lx = illuminance_lx * float(_LUMINANCE @ sun.color) * toward_sun[2]
    level_lx += math.pi * _level_luminance(radiance)
    exposure = table.brightness / level_lx if light.exposure is None else light.exposure
    environment = Environment(radiance).scaled(math.pi * exposure)
    return replace(lighting, exposure=exposure, environment=environment)


def _level_luminance(radiance: Floats32) -> float:
    """Luminance of a horizontal white surface under a map, in the map's unit."""
    return float(_LUMINANCE @ Environment(radiance).ambient(_UP)[0])


def _read_map(path: Path) -> Floats32:
    """Environment map (height, width, 3) from a file."""
    if path.suffix.lower() not in SUFFIXES:
        raise SceneError(f"{path}: expected an environment map (.hdr, .exr), got {path.suffix!r}")
    try:
        pixels = read_radiance(path)
    except OutputError as reason:
        raise SceneError(str(reason)) from None
    height, width = pixels.shape[:2]
    if width != 2 * height or not 2 <= height <= MAX_ROWS:
        raise SceneError(
            f"{path}: expected a map twice as wide as high, of at most {MAX_ROWS} rows, "
            f"got {width} × {height} px"
        )
    if not (np.isfinite(pixels).all() and (pixels >= 0.0).all()):
        raise SceneError(f"{path}: expected finite radiance of at least 0")
    return pixels


# Radiance of a clear sky.
#
# Source: Preetham, Shirley and Smits, "A practical analytic model for daylight", 1999, appendix
# A.2.

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


def clear_sky(toward_sun: Floats, turbidity: float) -> Floats32:
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
        zenith
        * _perez(coefficient, height, between)
        / _perez(coefficient, np.float64(1.0), sun_angle)
        for zenith, coefficient in zip(_zenith(sun_angle, turbidity), coefficients, strict=True)
    ]
    luminance, x, y = values
    xyz = np.stack((x / y * luminance, luminance, (1.0 - x - y) / y * luminance), axis=-1)
    rgb = np.maximum(xyz @ _RGB_FROM_XYZ.T, 0.0)
    weights = (angles[: ROWS // 2, None] * height)[..., None]
    ground = GROUND_REFLECTANCE / np.pi * (rgb * weights).sum(axis=(0, 1))
    return np.concatenate((rgb, np.broadcast_to(ground, rgb.shape))).astype(np.float32)


def sun_illuminance(toward_sun: Floats, turbidity: float) -> Floats:
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
    return 128_000.0 * np.exp(-mass * depth)


def _raised(toward_sun: Floats) -> Floats:
    lowest = np.sin(np.radians(MIN_SUN_ELEVATION_DEG))
    if toward_sun[2] >= lowest:
        return toward_sun
    level = toward_sun[:2] / max(float(np.hypot(*toward_sun[:2])), 1e-12)
    return np.array([*level * np.sqrt(1.0 - lowest**2), lowest])


def _perez(
    coefficients: Floats, height: Floats | np.float64, between: Floats | np.float64
) -> Floats:
    a, b, c, d, e = coefficients
    return (1.0 + a * np.exp(b / np.maximum(height, 0.01))) * (
        1.0 + c * np.exp(d * between) + e * np.cos(between) ** 2
    )


def _zenith(sun_angle: float, turbidity: float) -> tuple[float, float, float]:
    """Luminance, cd/m², and chromaticities x and y of the zenith."""
    spread = (4.0 / 9.0 - turbidity / 120.0) * (np.pi - 2.0 * sun_angle)
    luminance = (4.0453 * turbidity - 4.9710) * np.tan(spread) - 0.2155 * turbidity + 2.4192
    x, y = np.array([turbidity**2, turbidity, 1.0]) @ _ZENITH @ sun_angle ** np.arange(3, -1, -1)
    return 1000.0 * max(float(luminance), 0.0), float(x), float(y)


# Position and light of the sun, by time and place.
#
# The accuracy is 0.01° between the years 1950 and 2050, without refraction, which raises the sun by
# 0.5° at the horizon and by 0.02° at 45°.
# Source: Meeus, "Astronomical Algorithms", 2nd edition, 1998, chapters 12, 13, 22 and 25 (low
# accuracy); light: IESNA, "The Lighting Handbook", 9th edition, 2000, chapter 8 (clear sky).

_J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
_CENTURY_DAYS = 36525.0
_OUTSIDE_LX = 127_500.0  # above the atmosphere, at the mean distance
_EXTINCTION = 0.21  # optical depth of a clear sky


class SunPosition(NamedTuple):
    """Direction toward the sun."""

    elevation_deg: float  # elevation above the horizon; negative: below it
    azimuth_deg: float  # azimuth from north toward east

    def direction(self, north_deg: float) -> Floats:
        """Direction of travel (3,) of the sun's light, world frame.

        North is counter-clockwise from the world's x.
        """
        height, yaw = math.radians(self.elevation_deg), math.radians(north_deg - self.azimuth_deg)
        across = math.cos(height)
        return -np.array([across * math.cos(yaw), across * math.sin(yaw), math.sin(height)])


def sun_position(time: datetime, latitude_deg: float, longitude_deg: float) -> SunPosition:
    """Direction of the sun at a time with an offset from UTC, as seen from a position on Earth.

    Latitudes are positive in the north, longitudes in the east.
    """
    days = (time - _J2000).total_seconds() / 86400.0
    longitude, obliquity = _ecliptic(days / _CENTURY_DAYS)
    ascension = math.atan2(math.cos(obliquity) * math.sin(longitude), math.cos(longitude))
    declination = math.asin(math.sin(obliquity) * math.sin(longitude))
    sidereal_deg = 280.46061837 + 360.98564736629 * days + longitude_deg
    hour = math.radians(sidereal_deg % 360.0) - ascension
    latitude = math.radians(latitude_deg)
    east = -math.cos(declination) * math.sin(hour)
    north = math.sin(declination) * math.cos(latitude)
    north -= math.cos(declination) * math.cos(hour) * math.sin(latitude)
    up = math.sin(declination) * math.sin(latitude)
    up += math.cos(declination) * math.cos(hour) * math.cos(latitude)
    return SunPosition(
        math.degrees(math.atan2(up, math.hypot(east, north))),
        math.degrees(math.atan2(east, north)) % 360.0,
    )


def sun_illuminance_lx(elevation_deg: float) -> float:
    """Illuminance, lx, of a surface that faces the sun in a clear sky; 0 below the horizon."""
    height = math.sin(math.radians(elevation_deg))
    return _OUTSIDE_LX * math.exp(-_EXTINCTION / height) if height > 0.0 else 0.0


def _ecliptic(centuries: float) -> tuple[float, float]:
    """Apparent solar longitude and obliquity of the ecliptic, rad, from centuries since J2000."""
    mean_deg = 280.46646 + centuries * (36000.76983 + 0.0003032 * centuries)
    anomaly = math.radians(357.52911 + centuries * (35999.05029 - 0.0001537 * centuries))
    center_deg = (1.914602 - centuries * (0.004817 + 0.000014 * centuries)) * math.sin(anomaly)
    center_deg += (0.019993 - 0.000101 * centuries) * math.sin(2.0 * anomaly)
    center_deg += 0.000289 * math.sin(3.0 * anomaly)
    node = math.radians(125.04 - 1934.136 * centuries)
    longitude_deg = mean_deg + center_deg - 0.00569 - 0.00478 * math.sin(node)
    obliquity_deg = 23.4392911 - 0.0130042 * centuries + 0.00256 * math.cos(node)
    return math.radians(longitude_deg), math.radians(obliquity_deg)
