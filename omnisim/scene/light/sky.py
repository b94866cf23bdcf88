"""Sky of a scene: an environment map from a file, or a clear sky, with the table's brightness."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OutputError, SceneError
from omnisim.core.files.image_files import read_radiance
from omnisim.core.files.toml_file import find_beside
from omnisim.scene.files.scene_file import SceneFile
from omnisim.scene.light.clear_sky import clear_sky, sun_illuminance
from omnisim.scene.light.environment import Environment
from omnisim.scene.light.light_tables import LightTable, SkyTable, SunTable
from omnisim.scene.light.lighting import is_even
from omnisim.scene.light.sun import sun_illuminance_lx, sun_position
from omnisim.scene.model import Light, Lighting, LightKind, Scene

MAX_ROWS = 4096
SUFFIXES = ".hdr", ".exr"
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # weights of linear sRGB, Rec. 709
_UP = np.array([[0.0, 0.0, 1.0]])


def with_sky(scene: Scene, settings: SceneFile, toml: str, folder: Path) -> Scene:
    """Scene with the sky of its TOML file in place of even light; its lamps stay on.

    Args:
        scene: scene without the sky.
        settings: settings of the TOML file.
        toml: path of the TOML file, for messages.
        folder: base folder of a map's path.

    Raises:
        SceneError: a map that cannot be read or is invalid, or a clear sky at night.
    """
    table, before = settings.sky, scene.lighting
    if table is None:
        return scene
    was_even = is_even(before)
    lighting = replace(
        before,
        ambient=settings.light.ambient or (0.0, 0.0, 0.0),
        lights=() if was_even else before.lights,
        baked=None,
    )
    if table.file is not None:
        path = find_beside(folder, table.file, f"{toml}: sky.file", SceneError)
        lighting = _with_map(lighting, _turned(_read_map(path), table.yaw_deg), table.brightness)
    elif settings.sun is not None:
        lighting = _around_sun(lighting, table, settings.sun, settings.light, toml)
    else:
        lighting = _with_own_sun(lighting, table, settings.light)
    return replace(scene, lighting=lighting)


def _with_map(
    lighting: Lighting, radiance: NDArray[np.float32], brightness: float, sun: float = 0.0
) -> Lighting:
    """Lighting with a map, scaled to a given brightness of a level white surface.

    Args:
        lighting: lighting without the map.
        radiance: radiance of the map.
        brightness: brightness of the surface under the map and the sun.
        sun: luminance of the surface under the sun alone, in the map's unit.
    """
    level = sun + _level_luminance(radiance)
    scale = brightness / level if level > 0.0 else 1.0
    return replace(lighting, environment=Environment(radiance).scaled(scale))


def _with_own_sun(lighting: Lighting, table: SkyTable, light_table: LightTable) -> Lighting:
    """Lighting with a clear sky and its sun, at the table's brightness.

    Without other lamps, the exposure is that of the sun in lux.
    """
    toward_sun = _direction(table.sun_azimuth_deg, table.sun_elevation_deg)
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
    """Lighting with a clear sky around a sun in lux; sky, sun and lamps share one exposure.

    Raises:
        SceneError: the sun is below the horizon.
    """
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


def _level_luminance(radiance: NDArray[np.float32]) -> float:
    """Luminance of a horizontal white surface under a map, in the map's unit."""
    return float(_LUMINANCE @ Environment(radiance).ambient(_UP)[0])


def _read_map(path: Path) -> NDArray[np.float32]:
    """Environment map (height, width, 3) from a file.

    Raises:
        SceneError: an unsupported format, a wrong shape or invalid radiance.
    """
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


def _turned(radiance: NDArray[np.float32], yaw_deg: float) -> NDArray[np.float32]:
    """Map (height, width, 3), rotated counter-clockwise seen from above, by whole columns."""
    columns = round(-yaw_deg / 360.0 * radiance.shape[1])
    return np.roll(radiance, columns, axis=1)


def _direction(azimuth_deg: float, elevation_deg: float) -> NDArray[np.float64]:
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    level = math.cos(elevation)
    return np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])
