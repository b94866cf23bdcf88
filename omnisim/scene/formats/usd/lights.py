"""UsdLux lights as punctual lights."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path, PurePosixPath

import numpy as np
from pxr import Sdf, Usd, UsdLux

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_image, read_radiance
from omnisim.core.files.sources import SourceReader
from omnisim.core.srgb import linear_from_srgb8
from omnisim.scene.formats.imported_scene import Omissions
from omnisim.scene.formats.usd.surfaces import content_of, numbers
from omnisim.scene.light.environment import coordinates_of, lookup, map_directions
from omnisim.scene.parts import Light, LightKind

_FACING = {"RectLight", "DiskLight"}  # lights that shine along −z only
_APPROXIMATED = {"RectLight", "DiskLight", "CylinderLight"}
_HEMISPHERE = (1.0, 0.0)


def is_light(prim: Usd.Prim) -> bool:
    """True for every UsdLux light."""
    return bool(prim.HasAPI(UsdLux.LightAPI))


class Lights:
    """Lights of a stage, in the world frame."""

    def __init__(
        self,
        world_from_stage: Floats,
        time: Usd.TimeCode,
        notices: Omissions,
        reader: SourceReader,
    ):
        self.lights: list[Light] = []
        # linear RGB luminance of the first dome light, cd/m², and that (rows, 2 rows, 3) of its
        # texture, in world axes
        self.dome: tuple[float, float, float] | None = None
        self.environment: Floats32 | None = None
        self._world_from_stage, self._time = world_from_stage, time
        self._notices, self._reader = notices, reader

    def add(self, prim: Usd.Prim, stage_from_prim: Floats) -> None:
        """Add a light of any type; unsupported attributes become notices."""
        kind = str(prim.GetTypeName()).removesuffix("_1")
        level, color = self._level(prim), self._color(prim)
        if kind == "DomeLight":
            self._add_dome(prim, stage_from_prim, level * np.array(color))
            return
        if level <= 0.0 or not any(color):
            return
        world_from_light = self._world_from_stage @ stage_from_prim
        axis = -world_from_light[:3, 2]
        length = float(np.linalg.norm(axis))
        if not 0.0 < length < math.inf or not np.isfinite(world_from_light).all():
            return
        if kind == "DistantLight":
            # Source: UsdLuxDistantLight: π sin² of its half angle, or 1 if normalized
            half_rad = math.radians(0.5 * self._number(prim, "angle", 0.53))
            if half_rad > 0.0 and not self._get(prim, "normalize"):
                level *= math.pi * math.sin(min(half_rad, 0.5 * math.pi)) ** 2
            self.lights.append(Light(LightKind.DIRECTIONAL, color, level, direction=axis / length))
            return
        # the area is in square stage units, even if normalized, so that meters enter only once
        scale = np.linalg.norm(stage_from_prim[:3, :3], axis=0)
        unit = float(np.linalg.norm(self._world_from_stage[:3, 0]))
        candela = level * self._area_factor(prim, kind, scale) * unit * unit
        if candela <= 0.0 or not math.isfinite(candela):
            self._notices.count(f"{kind} is not drawn")
            return
        if kind in _APPROXIMATED:
            self._notices.count(f"{kind} is drawn as a lamp at its center, without its size")
        cone = self._cone(prim)
        if cone is None and kind in _FACING:
            cone = _HEMISPHERE
        self.lights.append(
            Light(
                LightKind.POINT if cone is None else LightKind.SPOT,
                color,
                candela,
                position_m=world_from_light[:3, 3],
                direction=axis / length,
                cone_cosines=cone or _HEMISPHERE,
            )
        )

    def _level(self, prim: Usd.Prim) -> float:
        """Luminance without the light's color, cd/m²."""
        level = self._number(prim, "intensity", 1.0)
        exposure = min(max(self._number(prim, "exposure", 0.0), -100.0), 100.0)
        return level * math.exp2(exposure) * self._number(prim, "diffuse", 1.0)

    def _color(self, prim: Usd.Prim) -> tuple[float, float, float]:
        red, green, blue = numbers(self._get(prim, "color"), (1.0, 1.0, 1.0))
        if self._get(prim, "enableColorTemperature"):
            kelvin = self._number(prim, "colorTemperature", 6500.0)
            tint = UsdLux.BlackbodyTemperatureAsRgb(min(max(kelvin, 1000.0), 10000.0))
            red, green, blue = red * tint[0], green * tint[1], blue * tint[2]
        return max(red, 0.0), max(green, 0.0), max(blue, 0.0)

    def _area_factor(self, prim: Usd.Prim, kind: str, scale: Floats) -> float:
        """Frontal luminous intensity per unit of luminance, in square stage units.

        Source: UsdLuxLightAPI: a normalized luminance is divided by the surface area.
        """
        radius = self._number(prim, "radius", 0.5)
        across = float(scale.mean())
        if kind == "SphereLight":
            if self._get(prim, "treatAsPoint"):
                radius = 1.0 if self._get(prim, "normalize") else radius
            seen, area = math.pi * radius**2 * across**2, 4.0 * math.pi * radius**2 * across**2
        elif kind == "RectLight":
            width, height = (self._number(prim, key, 1.0) for key in ("width", "height"))
            seen = area = width * height * float(scale[0] * scale[1])
        elif kind == "DiskLight":
            seen = area = math.pi * radius**2 * float(scale[0] * scale[1])
        elif kind == "CylinderLight":
            length = self._number(prim, "length", 1.0) * float(scale[0])
            seen = 2.0 * radius * across * length
            area = math.pi * seen
        else:
            return 0.0
        if not self._get(prim, "normalize"):
            return seen
        return seen / area if area > 0.0 else 0.0

    def _cone(self, prim: Usd.Prim) -> tuple[float, float] | None:
        """Cosines of a shaped light's inner and outer half-angles; None: no shaping."""
        angle = self._number(prim, "shaping:cone:angle", 90.0)
        if not prim.HasAPI(UsdLux.ShapingAPI) or not 0.0 < angle < 90.0:
            return None
        softness = min(max(self._number(prim, "shaping:cone:softness", 0.0), 0.0), 1.0)
        inner, outer = angle * (1.0 - softness), angle
        return math.cos(math.radians(inner)), math.cos(math.radians(outer))

    def _add_dome(self, prim: Usd.Prim, stage_from_prim: Floats, luminance: Floats) -> None:
        if self.dome is not None:
            self._notices.count("further DomeLight is not drawn")
            return
        texture = self._get(prim, "texture:file")
        if isinstance(texture, Sdf.AssetPath) and texture.path:
            world_from_dome = (self._world_from_stage @ stage_from_prim)[:3, :3]
            layout = str(self._get(prim, "texture:format") or "")
            pixels = dome_map(texture, layout, world_from_dome, self._reader)
            if pixels is None:
                self._notices.count("texture of a dome light is not drawn, only its color", "light")
            else:
                self.environment = (luminance * pixels).astype(np.float32)
                _, solid_angles = map_directions(*pixels.shape[:2])
                mean = np.average(pixels.mean(axis=1), axis=0, weights=solid_angles)
                luminance = luminance * mean
        red, green, blue = luminance.tolist()
        self.dome = red, green, blue

    def _get(self, prim: Usd.Prim, name: str) -> object:
        attribute = prim.GetAttribute(f"inputs:{name}")
        return attribute.Get(self._time) if attribute else None

    def _number(self, prim: Usd.Prim, name: str, default: float) -> float:
        value = self._get(prim, name)
        if isinstance(value, int | float) and math.isfinite(value):
            return float(value)
        return default


# Textures of dome lights as environment maps.
#
# Source: OpenUSD, previewSurface of Hydra Storm, projectToLatLong: the map's center is at +z,
# with +x to the left and +y at the top.

MAX_ROWS = 2048
ROWS_AT_ONCE = 64  # limits memory use
MAX_RADIANCE = 1e9
_DISPLAY = (".png", ".jpg", ".jpeg")  # formats whose 8-bit values are sRGB
_LAT_LONG = ("", "automatic", "latlong")
# Axes of omnisim's maps: +x in the center, +y to the left.
_DOME_FROM_MAP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def dome_map(
    texture: Sdf.AssetPath, layout: str, world_from_dome: Floats, reader: SourceReader
) -> Floats32 | None:
    """Radiance (rows, 2 rows, 3) of a dome's texture in world axes; None: not readable.

    `layout` is the light's `texture:format`, and `world_from_dome` (3, 3) its axes, of any length.
    """
    axes, _, turned = np.linalg.svd(world_from_dome)
    rotation = axes @ turned
    if layout not in _LAT_LONG or not np.isfinite(rotation).all():
        return None
    pixels = _read(texture.resolvedPath, reader)
    if pixels is None or min(pixels.shape[:2]) < 2:
        return None
    rows = min(max(pixels.shape[0], 2), MAX_ROWS)
    directions, _ = map_directions(rows, 2 * rows)
    parts = []
    for first in range(0, rows, ROWS_AT_ONCE):
        part = directions[first : first + ROWS_AT_ONCE].reshape(-1, 3)
        parts.append(lookup(pixels, coordinates_of(part @ rotation @ _DOME_FROM_MAP)))
    return np.concatenate(parts).reshape(rows, 2 * rows, 3)


def _read(resolved: str, reader: SourceReader) -> Floats32 | None:
    try:
        data = content_of(resolved, reader)
    except OSError:
        return None
    suffix = PurePosixPath(resolved.rstrip("]")).suffix.lower()
    if not data or not suffix.isascii() or not suffix[1:].isalnum():
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"map{suffix}")
        path.write_bytes(data)
        try:
            if suffix not in _DISPLAY:
                radiance = read_radiance(path)
            else:
                stored, _ = read_image(path)
                if stored.dtype != np.uint8 or stored.shape[2] < 3:
                    return None
                radiance = linear_from_srgb8(stored[..., :3])
        except OutputError:
            return None
    return np.clip(np.nan_to_num(radiance, posinf=MAX_RADIANCE), 0.0, MAX_RADIANCE)
