"""Shadow plan: placement of all lamps' maps in one texture, their matrices and lookup constants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.shadows.cascades import Cascades, cascade_count
from omnisim.rendering.opengl.shadows.lamp_views import (
    is_cube,
    light_axes,
    orthographic_clip,
    perspective_clips,
    punctual_view,
)
from omnisim.scene.model import Light, Lighting, LightKind

# Texels per map side, if they fit: of a single parallel map and of several, of a spot's map and of
# a cube face's.
_SINGLE_PX, _CASCADE_PX, _SPOT_PX, _FACE_PX = 4096, 2048, 2048, 1024
_MAX_TEXELS = 1 << 25
_MIN_PX = 64
_CUBE_COLUMNS = 3  # three faces in a row; the opposite faces below
_MAX_VERTEX_PLACES = 8  # varyings for map positions: every GPU has as many


class Block(NamedTuple):
    """Maps of one lamp, in a grid.

    Attributes:
        left_px, top_px: position in the texture.
        size_px: texels per side of each map.
        columns, rows: size of the grid.
    """

    left_px: int
    top_px: int
    size_px: int
    columns: int
    rows: int

    @property
    def rectangles_px(self) -> NDArray[np.float64]:
        """Left, top, width and height (maps, 4)."""
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        size = np.full(len(row), self.size_px)
        left, top = self.left_px + column * self.size_px, self.top_px + row * self.size_px
        return np.stack((left, top, size, size), axis=1).astype(np.float64)


@dataclass(frozen=True, eq=False)
class ShadowPlan:
    """Shadow maps of the lamps that cast shadows.

    Attributes:
        directional, punctual: lights of each kind, in the order of the scene.
        cascades: cascades of each directional light; None: it casts no shadow.
        cascade_count: number of cascades per directional light.
        blocks: maps of each caster, directional ones first.
        width_px, height_px: size of the texture.
    """

    directional: tuple[Light, ...]
    punctual: tuple[Light, ...]
    cascades: tuple[Cascades | None, ...]
    cascade_count: int
    blocks: tuple[Block, ...]
    width_px: int
    height_px: int

    @property
    def follows_viewpoint(self) -> bool:
        """True if some maps follow the viewpoint."""
        return self.cascade_count > 1

    @property
    def rectangles_px(self) -> NDArray[np.float64]:
        """Left, top, width and height (maps, 4) of all maps."""
        return np.concatenate([block.rectangles_px for block in self.blocks])

    @property
    def maps_that_follow(self) -> NDArray[np.bool_]:
        """Mask (maps,) of the maps that follow the viewpoint."""
        follow = np.zeros(sum(block.columns * block.rows for block in self.blocks), dtype=np.bool_)
        casting = sum(one is not None for one in self.cascades)
        of_light = np.arange(casting * self.cascade_count) % self.cascade_count
        follow[: casting * self.cascade_count] = of_light < self.cascade_count - 1
        return follow

    @property
    def kept_places_px(self) -> NDArray[np.intp]:
        """Left and top (n, 2) of a square in another texture for each map that follows."""
        count, size_px = int(np.count_nonzero(self.maps_that_follow)), self.blocks[0].size_px
        row, column = np.divmod(np.arange(count), self.width_px // size_px)
        return np.stack((column, row), axis=-1) * size_px

    @property
    def kept_size_px(self) -> tuple[int, int]:
        """Size of the texture of these squares, no larger than that of the maps."""
        width_px, height_px = self.kept_places_px.max(axis=0) + self.blocks[0].size_px
        return int(width_px), int(height_px)

    @property
    def punctual_casters(self) -> tuple[Light, ...]:
        """Point and spot lights that cast shadows."""
        return tuple(light for light in self.punctual if light.casts_shadow)

    def middles_m(self, viewpoint_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Centers (lights, cascades, 2) of the directional casters' cascades.

        Args:
            viewpoint_m: (3,) viewpoint relative to the anchor.
        """
        return np.array([one.middles_m(viewpoint_m) for one in self.cascades if one is not None])

    def clips(
        self, middles_m: NDArray[np.float64], anchor_m: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Matrices (maps, 4, 4) clip_from_anchor, given the cascades' centers."""
        casting = [one for one in self.cascades if one is not None]
        clips = [
            orthographic_clip(one.axes, middle_m, half_m, one.depths_m)
            for one, middles in zip(casting, middles_m, strict=True)
            for middle_m, half_m in zip(middles, one.halves_m, strict=True)
        ]
        for light, block in zip(self.punctual_casters, self.blocks[len(casting) :], strict=True):
            view = punctual_view(light, block.size_px)
            clips += list(perspective_clips(view, light.position_m - anchor_m))
        return np.array(clips)

    @property
    def casters(self) -> tuple[Light, ...]:
        """Lights that cast shadows, in the order of the blocks."""
        directional = zip(self.directional, self.cascades, strict=True)
        casting = [light for light, cascades in directional if cascades is not None]
        return (*casting, *self.punctual_casters)

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of shaders that look up shadows."""
        size_px = np.array([self.width_px, self.height_px], dtype=np.float64)
        regions = _regions(np.array([block.rectangles_px[0] for block in self.blocks]), size_px)
        vectors = [f"vec4({', '.join(map(str, region))})" for region in regions.tolist()]
        texels = [str(2.0 / block.size_px) for block in self.blocks]
        places = sum(not is_cube(light) for light in self.casters)
        return (
            "SHADOWS",
            f"SHADOW_CASCADES {self.cascade_count}",
            f"DIRECTIONAL_SHADOWS {len(self.casters) - len(self.punctual_casters)}",
            f"PUNCTUAL_SHADOWS {len(self.punctual_casters)}",
            f"DIRECTIONAL_CASTERS {_bits([one is not None for one in self.cascades])}",
            f"PUNCTUAL_CASTERS {_bits([light.casts_shadow for light in self.punctual])}",
            f"CUBE_CASTERS {_bits([is_cube(light) for light in self.punctual])}",
            f"SHADOW_REGIONS vec4[]({', '.join(vectors)})",
            f"SHADOW_TEXELS float[]({', '.join(texels)})",
            f"SHADOW_SCALES float[]({', '.join(map(str, self._scales()))})",
            f"PLACES {places}",
            *(("VERTEX_PLACES",) if 0 < places <= _MAX_VERTEX_PLACES else ()),
        )

    def _scales(self) -> list[float]:
        """Scale of each caster, see shaders/scene/shadow.glsl."""
        scales = [one.depth_scale for one in self.cascades if one is not None]
        blocks = self.blocks[len(scales) :]
        for light, block in zip(self.punctual_casters, blocks, strict=True):
            scales.append(1.0 / punctual_view(light, block.size_px).tangent)
        return scales

    def block_data(self, clips: NDArray[np.float64]) -> NDArray[np.float32]:
        """Values (n, 4) of the uniform block of shaders/scene/shadow_places.glsl.

        Args:
            clips: (maps, 4, 4) clip_from_anchor matrices.
        """
        places = [np.zeros((0, 4))]
        cascades = [np.zeros((0, 4))]
        ends = np.cumsum([block.columns * block.rows for block in self.blocks]).tolist()
        shapes = zip(self.casters, self.blocks, self._scales(), ends, strict=True)
        for light, block, scale, end in shapes:
            if is_cube(light):
                continue
            maps, finer = clips[end - block.columns : end], np.zeros((self.cascade_count - 1, 4))
            place = maps[-1, :3].copy()
            if light.kind is LightKind.DIRECTIONAL:
                place[2] /= scale
                widths = np.linalg.norm(maps[:, 0, :3], axis=1, keepdims=True)
                finer[:, 2:3] = widths[:-1] / widths[-1]
                finer[:, :2] = maps[:-1, :2, 3] - finer[:, 2:3] * maps[-1, :2, 3]
            else:
                place = np.concatenate((place[:2] / scale, maps[-1, 3:]))
            places.append(place)
            cascades.append(finer)
        return np.concatenate((*places, *cascades)).astype(np.float32)


def make_shadow_plan(
    lighting: Lighting,
    boxes_m: NDArray[np.float64],
    max_size_px: int,
) -> ShadowPlan:
    """Plan the maps of all lamps that cast shadows, at least one.

    If the maps of many lamps exceed the memory limit, all become smaller.

    Args:
        lighting: lighting of the scene.
        boxes_m: (n, 2, 3), minimum and maximum corners of the static geometry, from the anchor.
        max_size_px: maximum size of a texture.
    """
    directional, punctual = lighting.by_kind()
    axes = [light_axes(light.direction) if light.casts_shadow else None for light in directional]
    count = max((cascade_count(one, boxes_m) for one in axes if one is not None), default=1)
    cascades = tuple(None if one is None else Cascades(one, boxes_m, count) for one in axes)
    shapes = [
        (_CASCADE_PX if count > 1 else _SINGLE_PX, count, 1) for one in axes if one is not None
    ]
    shapes += [
        (_FACE_PX, _CUBE_COLUMNS, 2) if is_cube(light) else (_SPOT_PX, 1, 1)
        for light in punctual
        if light.casts_shadow
    ]
    blocks, size_px = _packed(shapes, max_size_px)
    return ShadowPlan(directional, punctual, cascades, count, blocks, *size_px)


def _packed(
    shapes: Sequence[tuple[int, int, int]], max_size_px: int
) -> tuple[tuple[Block, ...], tuple[int, int]]:
    """Place blocks given as (texels, columns, rows); return them and the size of the texture."""
    divisor = 1
    while True:
        smaller = [(max(size // divisor, _MIN_PX), *rest) for size, *rest in shapes]
        blocks, (width_px, height_px) = _on_shelves(smaller, min(8192, max_size_px))
        fits = width_px * height_px <= _MAX_TEXELS and max(width_px, height_px) <= max_size_px
        if fits or all(size == _MIN_PX for size, *_ in smaller):
            return blocks, (width_px, height_px)
        divisor *= 2


def _on_shelves(
    shapes: Sequence[tuple[int, ...]], width_px: int
) -> tuple[tuple[Block, ...], tuple[int, int]]:
    """Place blocks on shelves, tallest first; return them and the size of the texture."""
    placed: dict[int, Block] = {}
    left = top = shelf = right = 0
    for index in sorted(range(len(shapes)), key=lambda one: -shapes[one][0] * shapes[one][2]):
        size, columns, rows = shapes[index]
        if left and left + size * columns > width_px:
            left, top, shelf = 0, top + shelf, 0
        placed[index] = Block(left, top, size, columns, rows)
        left, shelf = left + size * columns, max(shelf, size * rows)
        right = max(right, left)
    return tuple(placed[index] for index in range(len(shapes))), (right, top + shelf)


def _regions(
    rectangles_px: NDArray[np.float64], texture_px: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Centers and half sizes (n, 4) of rectangles in texture coordinates."""
    half = 0.5 * rectangles_px[:, 2:] / texture_px
    return np.concatenate((rectangles_px[:, :2] / texture_px + half, half), axis=1)


def _bits(flags: Sequence[bool]) -> str:
    """Bit mask in GLSL."""
    return f"{sum(1 << number for number, flag in enumerate(flags) if flag)}u"
