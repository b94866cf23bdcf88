"""Shadow plan: placement of all lamps' maps in one texture, their matrices and lookup constants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.scene.model import LAMP_NEAR_M, Light, Lighting, LightKind

# Texels per map side, if they fit: of a single parallel map and of several, of a spot's map and of
# a cube face's.
_SINGLE_PX, _CASCADE_PX, _SPOT_PX, _FACE_PX = 4096, 2048, 2048, 1024
_MAX_TEXELS = 1 << 25
_MIN_PX = 64
_CUBE_COLUMNS = 3  # three faces in a row; the opposite faces below
_MAX_VERTEX_PLACES = 8  # varyings for map positions: every GPU has as many


class Block(NamedTuple):
    """Maps of one lamp, in a grid."""

    left_px: int  # position in the texture
    top_px: int
    size_px: int  # texels per side of each map
    columns: int  # size of the grid
    rows: int

    @property
    def rectangles_px(self) -> Floats:
        """Left, top, width and height (maps, 4)."""
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        size = np.full(len(row), self.size_px)
        left, top = self.left_px + column * self.size_px, self.top_px + row * self.size_px
        return np.stack((left, top, size, size), axis=1).astype(np.float64)


@dataclass(frozen=True, eq=False)
class ShadowPlan:
    """Shadow maps of the lamps that cast shadows."""

    directional: tuple[Light, ...]  # in the order of the scene
    punctual: tuple[Light, ...]  # in the order of the scene, too
    cascades: tuple[Cascades | None, ...]  # of each directional light; None: it casts no shadow
    cascade_count: int  # number of cascades per directional light
    blocks: tuple[Block, ...]  # maps of each caster, directional ones first
    width_px: int  # size of the texture
    height_px: int

    @property
    def follows_viewpoint(self) -> bool:
        """True if some maps follow the viewpoint."""
        return self.cascade_count > 1

    @property
    def rectangles_px(self) -> Floats:
        """Left, top, width and height (maps, 4) of all maps."""
        return np.concatenate([block.rectangles_px for block in self.blocks])

    @property
    def maps_that_follow(self) -> Bools:
        """Mask (maps,) of the maps that follow the viewpoint."""
        follow = np.zeros(sum(block.columns * block.rows for block in self.blocks), dtype=np.bool_)
        casting = sum(cascade is not None for cascade in self.cascades)
        of_light = np.arange(casting * self.cascade_count) % self.cascade_count
        follow[: casting * self.cascade_count] = of_light < self.cascade_count - 1
        return follow

    @property
    def kept_places_px(self) -> Indices:
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

    def middles_m(self, viewpoint_m: Floats) -> Floats:
        """Centers (lights, cascades, 2) of cascades, for a viewpoint (3,) from the anchor."""
        return np.array(
            [cascade.middles_m(viewpoint_m) for cascade in self.cascades if cascade is not None]
        )

    def clips(self, middles_m: Floats, anchor_m: Floats) -> Floats:
        """Matrices (maps, 4, 4) clip_from_anchor, given the cascades' centers."""
        casting = [cascade for cascade in self.cascades if cascade is not None]
        clips = [
            orthographic_clip(cascade.axes, middle_m, half_m, cascade.depths_m)
            for cascade, middles in zip(casting, middles_m, strict=True)
            for middle_m, half_m in zip(middles, cascade.halves_m, strict=True)
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
        first_px = np.array([block.rectangles_px[0] for block in self.blocks])
        half = 0.5 * first_px[:, 2:] / size_px
        regions = np.concatenate((first_px[:, :2] / size_px + half, half), axis=1)
        vectors = [f"vec4({', '.join(map(str, region))})" for region in regions.tolist()]
        texels = [str(2.0 / block.size_px) for block in self.blocks]
        places = sum(not is_cube(light) for light in self.casters)
        return (
            "SHADOWS",
            f"SHADOW_CASCADES {self.cascade_count}",
            f"DIRECTIONAL_SHADOWS {len(self.casters) - len(self.punctual_casters)}",
            f"PUNCTUAL_SHADOWS {len(self.punctual_casters)}",
            f"DIRECTIONAL_CASTERS {_bits([cascade is not None for cascade in self.cascades])}",
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
        scales = [cascade.depth_scale for cascade in self.cascades if cascade is not None]
        blocks = self.blocks[len(scales) :]
        for light, block in zip(self.punctual_casters, blocks, strict=True):
            scales.append(1.0 / punctual_view(light, block.size_px).tangent)
        return scales

    def block_data(self, clips: Floats) -> Floats32:
        """Uniform block (n, 4) of shadow_places.glsl, of matrices (maps, 4, 4) clip_from_anchor."""
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


def make_shadow_plan(lighting: Lighting, boxes_m: Floats, max_size_px: int) -> ShadowPlan:
    """Plan the maps of all lamps that cast shadows, at least one.

    If the maps of many lamps exceed the memory limit, all become smaller.

    Args:
        boxes_m: (n, 2, 3), minimum and maximum corners of the static geometry, from the anchor.
        max_size_px: maximum size of a texture.
    """
    directional, punctual = lighting.by_kind()
    axes = [light_axes(light.direction) if light.casts_shadow else None for light in directional]
    count = max((cascade_count(axis, boxes_m) for axis in axes if axis is not None), default=1)
    cascades = tuple(None if axis is None else Cascades(axis, boxes_m, count) for axis in axes)
    shapes = [
        (_CASCADE_PX if count > 1 else _SINGLE_PX, count, 1) for axis in axes if axis is not None
    ]
    shapes += [
        (_FACE_PX, _CUBE_COLUMNS, 2) if is_cube(light) else (_SPOT_PX, 1, 1)
        for light in punctual
        if light.casts_shadow
    ]
    divisor = 1
    while True:
        smaller = [(max(size // divisor, _MIN_PX), *rest) for size, *rest in shapes]
        blocks, size_px = _on_shelves(smaller, min(8192, max_size_px))
        fits = math.prod(size_px) <= _MAX_TEXELS and max(size_px) <= max_size_px
        if fits or all(size == _MIN_PX for size, *_ in smaller):
            return ShadowPlan(directional, punctual, cascades, count, blocks, *size_px)
        divisor *= 2


def _on_shelves(
    shapes: Sequence[tuple[int, ...]], width_px: int
) -> tuple[tuple[Block, ...], tuple[int, int]]:
    """Place blocks of (texels, columns, rows), tallest first; return the texture's size, too."""
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


def _bits(flags: Sequence[bool]) -> str:
    """Bit mask in GLSL."""
    return f"{sum(1 << number for number, flag in enumerate(flags) if flag)}u"


# Views of lamps: axes and matrices of their shadow maps.
#
# Positions are relative to an anchor, in world axes. Depth is reversed, as for the virtual cameras:
# 1 is near the lamp. A map's x and y are two axes of its view, in either handedness, because both
# sides of all surfaces cast shadows.

# Axes of cube faces as rows of x, y and forward: +z, +x, +y, then the opposite faces.
_CUBE_AXES = np.eye(3)[[[0, 1, 2], [1, 2, 0], [2, 0, 1]] * 2]
_CUBE_AXES[3:, 2] *= -1.0
_MAX_SPOT_RAD = math.radians(62.0)  # a cube resolves wider spots better
_SPOT_MARGIN = 1.02
_GUTTER_PX = 3.0  # beyond the 90° of a face, because lookups are offset from the surface


class PunctualView(NamedTuple):
    """Views of a point or spot light."""

    axes: Floats  # (faces, 3, 3), rows x, y and forward; one face, or the six of a cube
    tangent: float  # tangent of half of each face's field of view


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


def light_axes(direction: Floats) -> Floats:
    """Axes (3, 3), rows x, y and forward, of a view along a unit direction (3,)."""
    helper = np.eye(3)[0 if abs(direction[2]) > 0.9 else 2]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    return np.stack((x, np.cross(direction, x), direction))


def perspective_clips(view: PunctualView, position_m: Floats) -> Floats:
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
    axes: Floats, middle_m: Floats, half_m: float, depths_m: tuple[float, float]
) -> Floats:
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


# Cascades of directional lights: square regions of the scene, smaller ones near the viewpoint.
#
# The largest region contains all static geometry. The others follow the viewpoint in whole texels,
# so that shadow edges do not crawl, and so rarely that most frames reuse them.
# Source: Engel, "Cascaded Shadow Maps", ShaderX5, 2006.

# Half the width of a single map, meters: its texels are 12 mm.
_MAX_SINGLE_M = 24.0
_RATIO = 4.0  # between the widths of two cascades
MAX_CASCADES = 4
STEPS = 4  # of the viewpoint per half width
CELLS = 2 * STEPS  # grid cells per side of a cascade that follows the viewpoint
_BEYOND = 4.0  # half widths beyond the scene, for flying objects


class Cascades:
    """Cascades of one directional light.

    Args:
        axes: (3, 3) axes of the light: rows x, y and forward.
        boxes_m: (n, 2, 3), minimum and maximum corners of the static geometry, from the anchor.
        count: number of cascades, at most `MAX_CASCADES`.

    Attributes:
        halves_m: half widths, ascending.
        depths_m: minimum and maximum z along the axes.
        depth_scale: half the largest width as a share of the depth.
    """

    def __init__(self, axes: Floats, boxes_m: Floats, count: int):
        self.axes = axes
        low_m, high_m = _extent_m(axes, boxes_m)
        self._middle_m = 0.5 * (low_m + high_m)[:2]
        half_m = _half_m(low_m, high_m)
        self.halves_m = tuple(half_m / _RATIO**level for level in reversed(range(count)))
        self._steps_m = np.array(self.halves_m)[:-1, None] / STEPS  # of those that follow
        depth_m = 2.0 * _BEYOND * half_m + 3.0 * float(high_m[2] - low_m[2])
        # a power of two, as a constant of the shaders
        self.depth_scale = 2.0 ** -math.ceil(math.log2(depth_m / half_m))
        near_m = 0.5 * float(low_m[2] + high_m[2] - half_m / self.depth_scale)
        self.depths_m = near_m, near_m + half_m / self.depth_scale

    def middles_m(self, viewpoint_m: Floats) -> Floats:
        """Centers (cascades, 2) along the axes, for a viewpoint (3,) relative to the anchor."""
        near: Floats = self._steps(viewpoint_m) * self._steps_m
        return np.concatenate((near, self._middle_m[None]))

    def first_cells(self, viewpoint_m: Floats) -> Indices:
        """First grid cells (following, 2) of the cascades that follow a viewpoint (3,).

        Cells are a step wide; a cascade has `CELLS` per side. Cell 0 begins at the anchor.
        """
        return self._steps(viewpoint_m).astype(np.intp) - STEPS

    def _steps(self, viewpoint_m: Floats) -> Floats:
        """Centers (following, 2) of the cascades that follow a viewpoint, in steps."""
        return np.round(self.axes[:2] @ viewpoint_m / self._steps_m)


def cascade_count(axes: Floats, boxes_m: Floats) -> int:
    """Number of cascades that a light needs."""
    half_m, count = _half_m(*_extent_m(axes, boxes_m)), 1
    while half_m > _MAX_SINGLE_M and count < MAX_CASCADES:
        half_m /= _RATIO
        count += 1
    return count


def _extent_m(axes: Floats, boxes_m: Floats) -> tuple[Floats, Floats]:
    """Minimum and maximum coordinates (3,) of boxes (n, 2, 3) along axes."""
    if not len(boxes_m):
        return np.zeros(3), np.zeros(3)
    centers = boxes_m.mean(axis=1) @ axes.T
    extents = 0.5 * (boxes_m[:, 1] - boxes_m[:, 0]) @ np.abs(axes).T
    return (centers - extents).min(axis=0), (centers + extents).max(axis=0)


def _half_m(low_m: Floats, high_m: Floats) -> float:
    return max(0.5 * float((high_m - low_m)[:2].max()), 0.01) * 1.01


# Rectangles of shadow maps that dynamic objects may cover.
_MARGIN_PX = 1.0


def covered_px(
    clips: Floats, rectangles_px: Floats, centers_m: Floats, radii_m: Floats, starts: Indices
) -> Indices:
    """Non-empty rectangles (n, 4), left, top, width and height, that bound objects in maps.

    Args:
        clips: (maps, 4, 4) clip_from_anchor matrices.
        rectangles_px: (maps, 4) rectangles of the maps in the texture.
        centers_m: (items, 3) centers of bounding spheres, relative to the anchor, by object.
        radii_m: (items,) their radii.
        starts: (objects,) first item of each object.
    """
    rows = clips[:, (0, 1, 3)]  # x, y, w
    middle = np.einsum("mkc,ic->mik", rows[..., :3], centers_m) + rows[:, None, :, 3]
    reach = np.linalg.norm(rows[..., :3], axis=-1)[:, None] * radii_m[:, None]
    nearest, farthest = middle[..., 2] - reach[..., 2], middle[..., 2] + reach[..., 2]
    crosses = nearest <= 1e-6
    depths = np.stack((np.where(crosses, 1.0, nearest), np.where(crosses, 1.0, farthest)))
    low = np.min((middle - reach)[None, ..., :2] / depths[..., None], axis=0)
    high = np.max((middle + reach)[None, ..., :2] / depths[..., None], axis=0)
    low[crosses], high[crosses] = -1.0, 1.0  # the whole map
    behind = farthest <= 0.0
    low[behind], high[behind] = np.inf, -np.inf
    low = np.minimum.reduceat(low, starts, axis=1)
    high = np.maximum.reduceat(high, starts, axis=1)
    corner_px, size_px = rectangles_px[:, None, :2], rectangles_px[:, None, 2:]
    low_px = np.floor(np.clip(0.5 * (low + 1.0), 0.0, 1.0) * size_px - _MARGIN_PX)
    high_px = np.ceil(np.clip(0.5 * (high + 1.0), 0.0, 1.0) * size_px + _MARGIN_PX)
    low_px, high_px = np.maximum(low_px, 0.0), np.minimum(high_px, size_px)
    is_seen = np.all((low < 1.0) & (high > -1.0), axis=-1)
    covered = np.concatenate((corner_px + low_px, high_px - low_px), axis=-1)[is_seen]
    return covered.astype(np.intp)
