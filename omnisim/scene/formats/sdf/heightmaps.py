"""Terrain from gray images, with textures that vary with height.

The brightest pixel is at the height of the map's size, and black is at 0. The first image row is at
the largest y.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from omnisim.scene.formats.sdf.shapes import Shape
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.scene.primitives import Surface, grid_triangles

MAX_POINTS = 513  # per side, about half a million triangles
_BAKED_PX = (256, 2048)  # minimum and maximum side of a texture blended from several layers


class Layer(NamedTuple):
    """Texture layer of a terrain.

    Attributes:
        image: RGB image, which repeats.
        size_m: side length of one repetition.
        from_m, fade_m: height at which the layer starts, and height range over which it fades in.
    """

    image: Image.Image
    size_m: float
    from_m: float = 0.0
    fade_m: float = 0.0


def read_levels(image: Image.Image) -> NDArray[np.float64] | None:
    """Levels (rows, columns) in [0, 1], at most `MAX_POINTS` per side; None: not a gray image."""
    if image.mode.startswith("I"):
        levels = np.asarray(image, dtype=np.float64) / 65535.0
    elif image.mode == "F":  # an elevation model in meters
        return None
    else:
        levels = np.asarray(image.convert("RGB"), dtype=np.float64)[..., 0] / 255.0
    if min(levels.shape) < 2:
        return None
    rows, columns = (_evenly(count) for count in levels.shape)
    chosen: NDArray[np.float64] = levels[np.ix_(rows, columns)]
    return chosen


def _evenly(count: int) -> NDArray[np.intp]:
    """Indices (n,) of at most `MAX_POINTS` of `count` samples, first and last included."""
    return np.linspace(0, count - 1, min(count, MAX_POINTS)).round().astype(np.intp)


def terrain(element: XmlElement, levels: NDArray[np.float64], tile_m: float) -> Shape:
    """Surface of a `<heightmap>`.

    Args:
        element: element with size and position.
        levels: (rows, columns) levels in [0, 1].
        tile_m: side length of one texture repetition; 0: the whole terrain.

    Raises:
        SceneError: a width or depth is not above 0.
    """
    size = terrain_size_m(element)
    rows, columns = levels.shape
    x, y = np.linspace(-0.5, 0.5, columns) * size[0], np.linspace(-0.5, 0.5, rows) * size[1]
    heights = levels[::-1] / max(float(levels.max()), 1e-9) * size[2]
    grid_x, grid_y = np.meshgrid(x, y)
    positions = np.stack((grid_x, grid_y, heights), axis=-1)
    slope_y, slope_x = np.gradient(heights, y, x)
    normals = np.stack((-slope_x, -slope_y, np.ones_like(heights)), axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    tiles = (size[0] / tile_m, size[1] / tile_m) if tile_m > 0.0 else (1.0, 1.0)
    uv = np.stack((grid_x / size[0] + 0.5, 0.5 - grid_y / size[1]), axis=-1) * tiles
    surface = Surface(
        positions.reshape(-1, 3) + element.vector("pos", (0.0, 0.0, 0.0)),
        grid_triangles(rows, columns),
        normals.reshape(-1, 3),
    )
    return Shape(surface, uv.reshape(-1, 2), is_closed=False)


def terrain_size_m(element: XmlElement) -> tuple[float, ...]:
    """Width, depth and height of a `<heightmap>`.

    Raises:
        SceneError: a width or depth is not above 0.
    """
    size = element.vector("size", (1.0, 1.0, 1.0))
    if min(size[:2]) <= 0.0:
        raise (element.find("size") or element).error("a width and depth > 0")
    return size


def blend(layers: list[Layer], levels: NDArray[np.float64], size: tuple[float, ...]) -> Image.Image:
    """Image of the whole terrain from above, blended from its layers.

    Args:
        layers: layers from low to high.
        levels: (rows, columns) levels in [0, 1].
        size: size of the terrain, m.
    """
    finest = max(
        max(layer.image.size) * max(size[:2]) / layer.size_m for layer in layers
    )  # texels across the whole terrain
    side = round(min(max(finest, _BAKED_PX[0]), _BAKED_PX[1]))
    gray = Image.fromarray((levels / max(float(levels.max()), 1e-9)).astype(np.float32))
    heights = np.asarray(gray.resize((side, side), Image.Resampling.BILINEAR)) * size[2]
    baked = _tiled(layers[0], size, side).astype(np.float32)
    for layer in layers[1:]:
        weights = (heights - layer.from_m) / max(layer.fade_m, 1e-6)
        weights = np.clip(weights, 0.0, 1.0)[..., None]
        baked += weights * (_tiled(layer, size, side) - baked)
    return Image.fromarray(np.rint(baked).astype(np.uint8))


def _tiled(layer: Layer, size: tuple[float, ...], side: int) -> NDArray[np.uint8]:
    """Layer (side, side, 3) repeated over the terrain."""
    width, height = (
        min(max(1, round(side * layer.size_m / extent)), 4 * side) for extent in size[:2]
    )
    tile = np.asarray(layer.image.convert("RGB").resize((width, height)))
    repeats = -(-side // height), -(-side // width), 1
    return np.tile(tile, repeats)[:side, :side]
