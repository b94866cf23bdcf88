"""Parts of an image whose atlas is too large for one: rectangles, each with an atlas of its own.

The tiles of a part are cut out of those of the whole image, texel by texel: whole or in parts, an
image samples the same texels.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import AnyFloats, Floats, Indices
from omnisim.core.cube import FACE_FROM_RIG
from omnisim.core.errors import GraphicsError
from omnisim.rendering.atlas.sampling_density import dilate
from omnisim.rendering.atlas.tile_plan import Tile, TilePlan, pack_tiles

# Number of texels of an atlas, and of samples of an image, above which the image is drawn in parts,
# and the longest side of a part's atlas and samples. A texel takes 12 bytes of color and depth, and
# up to 26 more where planar mirrors and panes are in view; a sample takes 8.
MAX_TEXELS = 1 << 27
PART_PX = 8192
# Parts begin at multiples of this number of pixels, and their tiles at multiples of this number of
# texels in the whole atlas: shaders take derivatives from blocks of 2 × 2.
_STEP_PX = 8
_CELLS = 512  # of a grid of rays, along the image's longer side
# Shares of their neighbors by which cells are wider: of whole ones, for their curvature; and of
# those at a rim, where a flat lens may turn by 2.4 times the last whole cell.
_WIDER, _WIDER_AT_RIM = 0.25, 3.0
_MIN_DEPTH = 0.3  # of unit rays that a face's plane shows: its tiles end at 0.577


class ImagePart(NamedTuple):
    """Rectangle of an image, drawn from an atlas of its own."""

    rectangle_px: tuple[int, int, int, int]  # left, top, width and height in the image
    plan: TilePlan  # tiles of the atlas


def image_parts(
    camera: CentralCamera,
    plan: TilePlan,
    side_px: int,
    supersampling: int = 1,
    mesh_error_px: float = 0.0,
) -> list[ImagePart]:
    """Cut an image into parts whose atlases fit into one texture; usually it is a single part.

    Args:
        side_px: longest side of a texture.
        supersampling: samples per pixel side, which are drawn before they are averaged.
        mesh_error_px: largest distance of a pixel's ray from the camera model's.

    Returns:
        Parts that cover all pixels with a ray, with atlases of one size; the first has the most
        tiles.

    Raises:
        GraphicsError: even small parts need too large an atlas.
    """
    whole = ImagePart((0, 0, camera.width_px, camera.height_px), plan)
    if _fits(whole, supersampling, side_px, MAX_TEXELS):
        return [whole]
    lookups = _Lookups(camera, plan, mesh_error_px)
    part_px = min(side_px, PART_PX)
    parts: list[ImagePart] = []
    rectangles = [whole.rectangle_px]
    while rectangles:
        rectangle = rectangles.pop()
        tiles = lookups.tiles(rectangle)
        if not tiles:
            continue
        part = ImagePart(rectangle, pack_tiles(tiles, plan.max_level, plan.level_bias))
        if _fits(part, supersampling, part_px, part_px**2):
            parts.append(part)
            continue
        left, top, width, height = rectangle
        if max(width, height) <= _STEP_PX:
            raise GraphicsError(
                f"an atlas of {plan.width_px} × {plan.height_px} texels: expected at most "
                f"{part_px} × {part_px} for {_STEP_PX} px of the image; make "
                "virtual_cameras.size_px or texels_per_pixel smaller"
            )
        half = _STEP_PX * math.ceil(max(width, height) / (2 * _STEP_PX))
        if width >= height:
            rectangles += [(left + half, top, width - half, height), (left, top, half, height)]
        else:
            rectangles += [(left, top + half, width, height - half), (left, top, width, half)]
    width_px = max(part.plan.width_px for part in parts)
    height_px = max(part.plan.height_px for part in parts)
    return [
        part._replace(plan=replace(part.plan, width_px=width_px, height_px=height_px))
        for part in sorted(parts, key=lambda part: -len(part.plan.tiles))
    ]


def _fits(part: ImagePart, supersampling: int, side_px: int, max_texels: int) -> bool:
    """True if neither the samples nor the atlas have longer sides or more texels."""
    sides_px = [supersampling * side for side in part.rectangle_px[2:]]
    has_few_samples = max(sides_px) <= side_px and math.prod(sides_px) <= max_texels
    return has_few_samples and part.plan.fits(side_px, max_texels)


class _Lookups:
    """Places of a grid's cells of pixels on the faces of a plan, see `image_parts`."""

    def __init__(self, camera: CentralCamera, plan: TilePlan, mesh_error_px: float):
        self._plan = plan
        cell_px = max(1.0, max(camera.width_px, camera.height_px) / _CELLS)
        self._u, self._v = (
            np.linspace(-0.5, side - 0.5, 1 + math.ceil(side / cell_px))
            for side in (camera.width_px, camera.height_px)
        )
        rays = camera.ray_from_pixel(np.stack(np.meshgrid(self._u, self._v), axis=-1))
        valid = rays.valid[..., None]
        directions = np.where(valid, rays.directions, 0.0) @ camera.rig_from_optical.T
        directions = directions.astype(np.float32)
        self._error_px = mesh_error_px
        at_rim = _WIDER_AT_RIM + mesh_error_px / cell_px
        bounds = {
            face: _bounds(directions @ FACE_FROM_RIG[face].T, at_rim)
            for face in {tile.face for tile in plan.tiles}
        }
        self._seen = []  # cells within each tile
        for tile in plan.tiles:
            first, last = bounds[tile.face]
            first, last = np.maximum(first, tile.region[0]), np.minimum(last, tile.region[1])
            rows, columns = np.nonzero(np.all(first < last, axis=-1))
            self._seen.append(_SeenCells(columns, rows, first[rows, columns], last[rows, columns]))

    def tiles(self, rectangle: tuple[int, int, int, int]) -> list[Tile]:
        """The whole plan's tiles, cut to what a rectangle of the image looks up."""
        first_px = np.array(rectangle[:2]) - 0.5 - self._error_px
        last_px = first_px + rectangle[2:] + 2.0 * self._error_px
        tiles = []
        for tile, (columns, rows, first, last) in zip(self._plan.tiles, self._seen, strict=True):
            inside = (self._u[columns + 1] > first_px[0]) & (self._u[columns] < last_px[0])
            inside &= (self._v[rows + 1] > first_px[1]) & (self._v[rows] < last_px[1])
            if inside.any():
                bounds = first[inside].min(axis=0), last[inside].max(axis=0)
                tiles.append(_cut(tile, np.array(bounds), 1 << self._plan.max_level))
        return tiles


class _SeenCells(NamedTuple):
    """Cells (n,) that look up a tile, and what of it."""

    columns: Indices
    rows: Indices
    first: AnyFloats  # (n, 2), tangents
    last: AnyFloats  # (n, 2)


def _bounds(local: AnyFloats, wider_at_rim: float) -> tuple[AnyFloats, AnyFloats]:
    """Lower and upper tangents (rows, columns, 2) of cells by their corners; inverted: none."""
    corners = np.stack((local[:-1, :-1], local[:-1, 1:], local[1:, :-1], local[1:, 1:]))
    shown = corners[..., 2:] > _MIN_DEPTH
    tangents = corners[..., :2] / np.where(shown, corners[..., 2:], 1.0)
    first = np.where(shown, tangents, np.inf).min(axis=0)
    last = np.where(shown, tangents, -np.inf).max(axis=0)
    size = np.where(shown.any(axis=0), last - first, 0.0)
    of_neighbors = np.stack([dilate(size[..., axis]) for axis in (0, 1)], axis=-1)
    wider = np.where(shown.all(axis=0), _WIDER, wider_at_rim) * of_neighbors
    return first - wider, last + wider


def _cut(tile: Tile, bounds: Floats, step: int) -> Tile:
    """Tile cut to tangents (2, 2), with a gutter of two of the largest mip texels of `step`."""
    block = max(step, _STEP_PX)
    origin = np.array(tile.origin_px)
    corner = np.array(tile.face_corner_px)  # of the face, in the whole atlas
    texels = 0.5 * tile.face_size_px * (bounds + 1.0) + [[-2 * step], [2 * step]]
    texels = np.clip(texels, origin, origin + tile.size_px) + corner
    first = block * np.floor(texels[0] / block).astype(int)
    last = block * np.ceil(texels[1] / block).astype(int)
    (left, top), (width, height) = (first - corner).tolist(), (last - first).tolist()
    return replace(tile, origin_px=(left, top), size_px=(width, height))
