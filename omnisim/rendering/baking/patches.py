"""Patches: surface elements of one texel each, which gather and reflect light."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Floats32, Indices, Ints32
from omnisim.rendering.baking.lightmap_atlas import Atlas, corner_pixels
from omnisim.rendering.baking.specular import SpecularSurfaces
from omnisim.rendering.rays.caster import RayHits
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.rays.shading.shading import RayView

FRONT, BACK = 0, 1
NO_PATCH = -1
_SAMPLES_WITHOUT_TEXELS = 32
_MAX_STEPS = 8  # from a texel without a patch to one with a patch
_FIRST, _LAST, _ALL = slice(None, -1), slice(1, None), slice(None)
_ALONG = {-1: (_LAST, _FIRST), 0: (_ALL, _ALL), 1: (_FIRST, _LAST)}
# Slices of an atlas and of its neighbors in each of eight directions: (texels, neighbors).
NEIGHBORS = tuple(
    ((_ALONG[down][0], _ALONG[right][0]), (_ALONG[down][1], _ALONG[right][1]))
    for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1))
)


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of a scene: sides of texels, and of instances without texels."""

    samples: SurfaceSamples  # sample points of the patches
    of_sample: Indices  # (k,) indices of the samples, patch after patch
    first: Indices  # (p + 1,) first entry of each patch in `of_sample`
    sides: NDArray[np.int8]  # (p,) `FRONT` or `BACK`
    surfaces: Ints32  # (p,) instance of each patch
    places: Indices  # (p,) texel; outside of the atlas: atlas size + instance
    areas_m2: Floats32  # (p,) areas
    albedo: Floats32  # (p, 3) diffuse reflectance, linear RGB
    transmitted: Floats32  # (p, 3) diffuse transmittance of frosted glass, from the opposite patch
    emission: Floats32  # (p, 3) emitted light, as seen
    spacing_m: Floats32  # (p,) texel width
    of_place: Ints32  # (2, places) int32 patch on each side of each place; `NO_PATCH`: none
    corners_px: Floats32  # (m, 3, 2) triangle corners in the atlas
    is_hollow: Bools  # (m,) the back of the triangle faces open space, not the inside of a solid
    has_rect: Bools  # (surfaces,) instances with a rectangle in the atlas
    # (surfaces,) texels from the place of a front to that of its back; 0: no back
    back_shift: Indices
    charts: Ints32  # (height, width) chart of each texel of the atlas; -1: none

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the atlas."""
        height, width = self.charts.shape
        return width, height

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self.sides)

    @property
    def atlas_places(self) -> Indices:
        """Texels (p,) in the atlas; backs have a rectangle of their own."""
        shifts = np.where(self.sides == BACK, self.back_shift[self.surfaces], 0)
        return self.places + shifts

    @property
    def opposite(self) -> Ints32:
        """Patches (p,) on the other side of each; `NO_PATCH`: none."""
        return self.of_place[1 - self.sides, self.places]

    def kept(self, is_kept: Bools) -> Patches:
        """The same patches with only the selected entries of `of_sample`."""
        counts = np.concatenate(([0], np.cumsum(is_kept)))
        return replace(self, of_sample=self.of_sample[is_kept], first=counts[self.first])


def build_patches(
    rays: RayScene, specular: SpecularSurfaces, atlas: Atlas, is_hollow: Bools
) -> Patches:
    """Patches of all static instances, ordered by place, fronts first; see `Patches`."""
    geometry, scene = rays.caster.geometry, rays.scene
    width, height = atlas.size_px
    swapped = [
        bool(np.linalg.det(instance.world_from_mesh[:3, :3]) < 0) for instance in scene.instances
    ]
    corners_px = corner_pixels(scene, atlas, swapped)
    has_rect = atlas.rects_px[:, 2] > 0
    in_atlas = np.flatnonzero(has_rect[geometry.surface_of_triangle])
    corners_m = geometry.corners_m(np.arange(len(geometry.corners), dtype=np.int32))
    edges_m = corners_m[:, 1:] - corners_m[:, :1]
    triangle_m2 = 0.5 * np.linalg.norm(np.cross(edges_m[:, 0], edges_m[:, 1]), axis=1)
    spread = _spread_samples(triangle_m2, geometry.first_of_surface, ~has_rect, width * height)
    found = [rasterize(corners_px, in_atlas, width), spread]
    samples = SurfaceSamples(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
    samples = samples.take(np.argsort(samples.texels, kind="stable"))
    places, first, counts = np.unique(samples.texels, return_index=True, return_counts=True)
    surfaces = geometry.surface_of_triangle[samples.triangles[first]]
    albedo, transmitted, emission = _appearance(rays, specular, samples)
    of_triangle = np.bincount(samples.triangles, minlength=len(triangle_m2))
    areas = triangle_m2[samples.triangles] / of_triangle[samples.triangles]
    areas[samples.texels >= width * height] = 0.0

    def means(values: Floats32) -> Floats32:
        sums = np.add.reduceat(values, first, axis=0) if len(first) else values[:0]
        return (sums / counts[:, None]).astype(np.float32)

    patch_m2 = np.add.reduceat(areas, first) if len(first) else areas[:0]
    whole_m2 = np.add.reduceat(triangle_m2, geometry.first_of_surface[:-1])
    without = places >= width * height
    patch_m2[without] = whole_m2[surfaces[without]]
    has_back = is_hollow[samples.triangles[first]]
    backs = np.flatnonzero(has_back)
    both = np.concatenate((np.arange(len(places)), backs))
    of_place = np.full((2, width * height + len(scene.instances)), NO_PATCH, dtype=np.int32)
    of_place[FRONT, places] = np.arange(len(places))
    of_place[BACK, places[backs]] = len(places) + np.arange(len(backs))
    charts = atlas.charts([instance.mesh for instance in scene.instances])
    of_place[:, : width * height] = _spread_to_empty(of_place[:, : width * height], charts)
    from_front = atlas.back_rects_px[:, :2] - atlas.rects_px[:, :2]
    sizes = counts[both]
    starts = np.concatenate(([0], np.cumsum(sizes)))
    of_sample = np.repeat(first[both] - starts[:-1], sizes) + np.arange(starts[-1])
    return Patches(
        samples,
        of_sample,
        starts,
        (np.arange(len(both)) >= len(places)).astype(np.int8),
        surfaces[both].astype(np.int32),
        places[both],
        patch_m2[both].astype(np.float32),
        means(albedo)[both],
        means(transmitted)[both],
        means(emission)[both],
        atlas.texels_m[surfaces[both]].astype(np.float32),
        of_place,
        corners_px,
        is_hollow,
        has_rect,
        np.where(atlas.back_rects_px[:, 2] > 0, from_front[:, 1] * width + from_front[:, 0], 0),
        charts,
    )


def _spread_samples(
    triangle_m2: Floats, first_of_surface: Indices, is_taken: Bools, first_place: int
) -> SurfaceSamples:
    """Samples of surfaces without texels, spread evenly by area."""
    count = _SAMPLES_WITHOUT_TEXELS
    surfaces = np.flatnonzero(is_taken)
    ends = np.cumsum(triangle_m2)
    whole = np.concatenate(([0.0], ends))
    low, high = whole[first_of_surface[surfaces]], whole[first_of_surface[surfaces + 1]]
    shares = (np.arange(count) + 0.5) / count
    triangles = np.searchsorted(ends, low[:, None] + shares * (high - low)[:, None])
    last = first_of_surface[surfaces + 1, None] - 1
    triangles = np.clip(triangles, first_of_surface[surfaces, None], last).ravel()
    first = np.sqrt((np.arange(count) * 0.7548776662466927 + 0.5) % 1.0)
    second = (np.arange(count) * 0.5698402909980532 + 0.5) % 1.0
    weights = np.stack((1.0 - first, first * (1.0 - second), first * second), axis=1)
    return SurfaceSamples(
        np.repeat(first_place + surfaces, count),
        triangles.astype(np.int32),
        np.tile(weights, (len(surfaces), 1)).astype(np.float32),
    )


def _appearance(
    rays: RayScene, specular: SpecularSurfaces, samples: SurfaceSamples
) -> tuple[Floats32, Floats32, Floats32]:
    """Diffuse reflectance, diffuse transmittance and emission (n, 3) at samples."""
    flat = np.zeros((len(samples.triangles), 3), dtype=np.float32)
    hits = RayHits(samples.triangles, np.zeros(len(flat)), samples.weights, flat)
    colors = rays.shading.base_colors(RayView.of(hits))
    emission = rays.shading.emitted(hits)
    surfaces = rays.shading.surfaces(hits)
    emission[colors[:, 3] < rays.shading.hit_cutoff[surfaces]] = 0.0
    diffuse = specular.diffuse(hits, np.clip(colors[:, :3], 0.0, 1.0))
    diffuse.reflected[rays.shading.is_unlit[surfaces]] = 0.0
    return diffuse.reflected, diffuse.transmitted, emission


def _spread_to_empty(of_texel: Ints32, charts: Ints32) -> Ints32:
    """Patches (2, texels), empty ones filled from neighbors, of their own chart if any are near."""
    from scipy.ndimage import distance_transform_edt

    height, width = charts.shape
    fronts = of_texel[FRONT].reshape(height, width)
    if (fronts == NO_PATCH).all():
        return of_texel
    nearest = np.where(fronts == NO_PATCH, -1, np.arange(fronts.size).reshape(height, width))
    for _ in range(_MAX_STEPS):
        empty = nearest < 0
        for to, of in NEIGHBORS:
            some = empty[to] & (nearest[of] >= 0) & (charts[to] == charts[of])
            nearest[to] = np.where(some & (nearest[to] < 0), nearest[of], nearest[to])
    rows, columns = distance_transform_edt(nearest < 0, return_distances=False, return_indices=True)
    return of_texel[:, nearest[rows, columns].ravel()]


# Rasterization of triangles in an atlas: position of each texel part on a triangle.
GRID = 2  # parts per texel side
_BATCH = 1 << 21  # candidates at once


class SurfaceSamples(NamedTuple):
    """Points of surfaces, each in a texel."""

    texels: Indices  # (n,) row · width + column in the atlas
    triangles: Ints32  # (n,) int32 triangle indices
    weights: Floats32  # (n, 3) float32 barycentric weights

    def take(self, indices: Indices) -> SurfaceSamples:
        """The selected samples."""
        return SurfaceSamples(self.texels[indices], self.triangles[indices], self.weights[indices])


def rasterize(corners_px: Floats32, triangles: Indices, width_px: int) -> SurfaceSamples:
    """Samples of triangles on a grid of `GRID` × `GRID` in each texel.

    A slim triangle also has samples along its middle line, so that its whole length is covered.

    Args:
        corners_px: (m, 3, 2) corners of all triangles.
        triangles: (k,) indices of the triangles in the atlas.
        width_px: width of the atlas.
    """
    samples = [
        SurfaceSamples(np.empty(0, np.intp), np.empty(0, np.int32), np.empty((0, 3), np.float32))
    ]
    corners = corners_px[triangles].astype(np.float64) * GRID - 0.5
    low = np.ceil(corners.min(axis=1) - 1e-9).astype(np.intp)
    high = np.floor(corners.max(axis=1) + 1e-9).astype(np.intp)
    spans = np.maximum(high - low + 1, 0)
    ends = np.cumsum(spans.prod(axis=1))
    total = int(ends[-1]) if len(ends) else 0
    starts = np.searchsorted(ends, np.arange(0, max(total, 1), _BATCH))
    has_sample = np.zeros(len(triangles), dtype=np.bool_)
    for first, last in zip(starts, [*starts[1:], len(triangles)], strict=True):
        some = np.arange(first, last)
        if len(some) == 0:
            continue
        owner, points = _candidates(low[some], spans[some])
        inside, weights = _weights(corners[some][owner], points)
        owner = some[owner[inside]]
        has_sample[owner] = True
        texels = points[inside] // GRID
        samples.append(
            SurfaceSamples(
                texels[:, 1] * width_px + texels[:, 0],
                triangles[owner].astype(np.int32),
                weights.astype(np.float32),
            )
        )
    samples.append(_slim_samples(corners_px, triangles, has_sample, width_px))
    return SurfaceSamples(*(np.concatenate(parts) for parts in zip(*samples, strict=True)))


def _slim_samples(
    corners_px: Floats32, triangles: Indices, has_sample: Bools, width_px: int
) -> SurfaceSamples:
    """Samples of slim triangles, from a corner to the middle of the shortest edge."""
    corners = corners_px[triangles].astype(np.float64)
    edges = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)  # opposite to each corner
    lengths = np.linalg.norm(edges, axis=2)
    area = np.abs(_cross(edges[:, 0], edges[:, 1]))
    is_slim = ~has_sample | (area < lengths.max(axis=1))
    slim = np.flatnonzero(is_slim)
    apex = lengths[slim].argmin(axis=1)
    counts = np.ceil(GRID * lengths[slim].max(axis=1)).astype(np.intp) + 1
    owner = np.repeat(np.arange(len(slim)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    away = (within + 0.5) / counts[owner]
    weights = np.repeat(0.5 * away[:, None], 3, axis=1)
    weights[np.arange(len(owner)), apex[owner]] = 1.0 - away
    points = np.floor(np.einsum("nk,nkc->nc", weights, corners[slim[owner]])).astype(np.intp)
    return SurfaceSamples(
        points[:, 1] * width_px + points[:, 0],
        triangles[slim[owner]].astype(np.int32),
        weights.astype(np.float32),
    )


def _candidates(low: Indices, spans: Indices) -> tuple[Indices, Indices]:
    """Triangles (n,) and grid points (n, 2) within the triangles' bounds."""
    counts = spans.prod(axis=1)
    owner = np.repeat(np.arange(len(low)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    wide = spans[owner, 0]
    return owner, low[owner] + np.stack((within % wide, within // wide), axis=1)


def _weights(corners: Floats, points: Indices) -> tuple[Indices, Floats]:
    """Indices of the points (n, 2) inside their triangles (n, 3, 2), and barycentric weights."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = _cross(b - a, c - a)
    second, third = _cross(points - a, c - a), _cross(b - a, points - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = np.stack((second, third), axis=1) / area[:, None]
        first = 1.0 - weights.sum(axis=1)
        inside = np.flatnonzero((weights.min(axis=1) >= -1e-9) & (first >= -1e-9))
    return inside, np.column_stack((first[inside], weights[inside]))


def _cross(one: Floats, other: Floats) -> Floats:
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
