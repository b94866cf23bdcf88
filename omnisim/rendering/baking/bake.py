"""Baking of a scene's light."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from omnisim.rendering.baking.atlas.atlas import automatic_atlas, build_atlas
from omnisim.rendering.baking.atlas.bake_tiles import Arrays, Progress, TileFolder, in_tiles
from omnisim.rendering.baking.atlas.patches import NO_PATCH, Patches, build_patches
from omnisim.rendering.baking.denoising import TexelSurfaces, denoised
from omnisim.rendering.baking.emitters import (
    LUMINANCE,
    Emitters,
    Points,
    lamp_light,
    lamps_on,
    points_at,
    usable,
)
from omnisim.rendering.baking.gathering import Gatherer
from omnisim.rendering.baking.probes import ProbeBaker, ProbeGrid
from omnisim.rendering.baking.sampling import Floats, generator, spread_points
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.rendering.baking.specular import SpecularSurfaces
from omnisim.rendering.baking.transport import INSIDE, SKY, Transport
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.scene.model import Mesh, Scene

TILE = 4096  # patches
_LINKS = 32  # rays per patch, along which all bounces but the last are computed
_AIMED_LINKS = 16  # rays to emitters
_MAX_PLACES = 32
_BRIGHT = 4.0  # times the mean: rays are aimed at patches that reflect more
_MAX_HALF = 6e4  # within half floats
_TRIED_PATCHES = 8  # one in 8 patches is tried to choose the lights to aim at
_DIRECT, _GATHER = range(2)  # stages of random numbers


class BakedPatches(NamedTuple):
    """Light on the patches of a scene.

    Attributes:
        patches: patches of the scene.
        lamps: (p, 3) light of lamps.
        gathered: (p, 3) all other light.
        halves: (p, 2, 3) the same from the even and the odd rays, separately.
        radiosity: (p, 3) reflected light.
        is_valid: (p,) the patch has light.
    """

    patches: Patches
    lamps: Floats
    gathered: Floats
    halves: Floats
    radiosity: Floats
    is_valid: NDArray[np.bool_]


class Bake:
    """Bake of a scene, tile by tile.

    Args:
        scene: scene to bake; its dynamic objects are ignored.
        settings: settings of the bake.

    Raises:
        OmnisimError: a package is missing, or texels are too small.
    """

    def __init__(self, scene: Scene, settings: BakeSettings):
        self.scene, self.settings = scene, settings
        self.rays = RayScene(scene)
        hollow = hollow_triangles(scene)
        has_back = instances_of(scene, hollow)
        self.texel_m, self.atlas = (
            automatic_atlas(scene, has_back, settings.texels)
            if settings.texel_m is None
            else (settings.texel_m, build_atlas(scene, settings.texel_m, has_back))
        )
        specular = SpecularSurfaces(self.rays)
        patches = build_patches(self.rays, specular, self.atlas, hollow)
        self.patches = usable(self.rays, Transport(self.rays, specular, patches), patches)
        self.transport = Transport(self.rays, specular, self.patches)
        entries = len(self.patches.of_sample)
        self._points = points_at(self.rays, self.transport, self.patches, 0, entries)
        self._links = min(_LINKS, settings.samples)
        self._coarse_emitters = self._emitters(self.patches.emission, _AIMED_LINKS, self._links)
        self.gatherer = Gatherer(scene.lighting, self.transport, settings.samples)
        self._coarse = Gatherer(scene.lighting, self.transport, self._links)
        self.tiles = -(-self.patches.count // TILE)

    def run(self, folder: TileFolder, jobs: int | None, progress: Progress) -> BakedPatches:
        """Light on all patches."""
        direct = _joined(in_tiles(folder, "direct light", self._direct, self.tiles, jobs, progress))
        radiosity = self._solve(direct)

        bright = self._bright(radiosity)
        lights = np.where(bright[:, None], radiosity + self.patches.emission, np.float32(0.0))
        samples = self.settings.samples
        emitters = self._emitters(lights, max(8, samples // 4 * 2), samples)
        others = np.where(bright[:, None], np.float32(0.0), radiosity)

        def gather(tile: int) -> Arrays:
            return self._gather(tile, others, emitters)

        bounced = _joined(in_tiles(folder, "bounces", gather, self.tiles, jobs, progress))
        return BakedPatches(
            self.patches,
            direct["lamps"],
            bounced["light"],
            bounced["halves"],
            self._scattered(direct["lamps"] + bounced["light"]),
            bounced["is_valid"],
        )

    def try_tile(self, tile: int) -> None:
        """Compute the light of a tile and discard it, to measure its time."""
        self._direct(tile)
        self._gather(tile, np.zeros_like(self.patches.emission), self._coarse_emitters)

    def light(self, baked: BakedPatches) -> Floats:
        """Denoised light (p, 3) of patches.

        On frosted glass it is the light on an opaque surface of the same color and brightness.
        """
        surfaces = self.surfaces(baked.is_valid)
        light = baked.lamps + denoised(self.patches, surfaces, baked.gathered, baked.halves)
        colors = self.patches.albedo + self.patches.transmitted
        some = np.flatnonzero(self.patches.transmitted.any(axis=1))
        shown = self._scattered(light)[some] / np.maximum(colors[some], np.float32(1e-6))
        light[some] = shown
        return light

    def probes(
        self, folder: TileFolder, baked: BakedPatches, jobs: int | None, progress: Progress
    ) -> tuple[ProbeGrid, Arrays]:
        """Grid of probes, and their arrays by name.

        The arrays are spherical harmonics (nx, ny, nz, 9, 3) and validity (nx, ny, nz).
        """
        baker = self.prober(baked.radiosity + self.patches.emission)
        tiles = _joined(in_tiles(folder, "probes", baker.bake, baker.tiles, jobs, progress))
        shape = baker.grid.shape
        return baker.grid, {key: one.reshape(*shape, *one.shape[1:]) for key, one in tiles.items()}

    def prober(self, seen: Floats) -> ProbeBaker:
        """Baker of the probes, from the light (p, 3) that leaves the patches."""
        return ProbeBaker(self.scene, self.transport, self.gatherer, seen, self.settings.seed)

    def surfaces(self, is_valid: NDArray[np.bool_]) -> TexelSurfaces:
        """Surfaces at the patches, at the first sample of each."""
        positions, normals = np.zeros((2, self.patches.count, 3), dtype=np.float32)
        for tile in range(self.tiles):
            first, last = self._range(tile)
            some, places = self._places(first, last)
            if len(some):
                positions[first + some] = places[0].origins_m
                normals[first + some] = places[0].normals
        return TexelSurfaces(positions, normals, is_valid)

    def _emitters(self, emission: Floats, aimed: int, gathered: int) -> Emitters:
        return Emitters(self.patches, self._points, emission, aimed, gathered)

    def _bright(self, radiosity: Floats) -> NDArray[np.bool_]:
        """Mask (p,) of patches that emit, or reflect far more light than the mean."""
        luminance, areas_m2 = radiosity @ LUMINANCE, self.patches.areas_m2
        mean = np.sum(luminance * areas_m2) / max(float(areas_m2.sum()), 1e-30)
        bright: NDArray[np.bool_] = luminance > _BRIGHT * mean
        bright |= np.any(self.patches.emission > 0.0, axis=1)
        return bright

    def _range(self, tile: int) -> tuple[int, int]:
        return tile * TILE, min((tile + 1) * TILE, self.patches.count)

    def _places(self, first: int, last: int) -> tuple[NDArray[np.intp], list[Points]]:
        """Patches with samples in a range, and sets of points, each with one sample per patch.

        Rays use the sets in turn.
        """
        starts = self.patches.first[first : last + 1]
        counts = np.diff(starts)
        some = np.flatnonzero(counts)
        if not len(some):
            return some, []
        points = points_at(self.rays, self.transport, self.patches, starts[0], starts[-1])
        base, counts = starts[some] - starts[0], counts[some]
        number = int(min(counts.max(), _MAX_PLACES))
        places = []
        for at in range(number):
            entries = base + np.where(counts <= number, at % counts, at * counts // number)
            places.append(Points(*(values[entries] for values in points)))
        return some, places

    def _direct(self, tile: int) -> Arrays:
        """Light of lamps, and links between patches with the light along them."""
        first, last = self._range(tile)
        count = last - first
        lamps, other = np.zeros((2, count, 3), dtype=np.float32)
        links = np.full((count, self._links), SKY, dtype=np.int32)
        is_specular = self.transport.specular.any
        shares = np.zeros((count, self._links, 3), dtype=np.float16) if is_specular else None
        some, places = self._places(first, last)
        if len(some):
            lamps[some] = self._lamps(places)
            random = generator(self.settings.seed, _DIRECT, tile)
            shifts = random.random((count, 6), dtype=np.float32)[some]
            emitters = self._focused(self._coarse_emitters, places, shifts[:, 4:])
            hits, cosines = self._coarse.hits(places, shifts[:, :2], 0, self._links)
            nothing = np.zeros((self.patches.count, 3), dtype=np.float32)
            light = self._coarse.seen(hits, cosines, nothing, emitters)
            valid = np.maximum((hits.patches != INSIDE).reshape(len(some), -1).sum(axis=1), 1)
            other[some] = light.reshape(len(some), -1, 3).sum(axis=1) / valid[:, None]
            other[some] += self._aimed(emitters, places, shifts[:, 2:4]).sum(axis=1)
            links[some] = hits.patches.reshape(len(some), -1)
            if shares is not None:
                of_links = hits.shares.reshape(len(some), self._links, -1)
                shares[some] = np.minimum(of_links, _MAX_HALF)
        tile_light = {"lamps": lamps, "other": other, "links": links}
        return tile_light if shares is None else tile_light | {"shares": shares}

    def _lamps(self, places: list[Points]) -> Floats:
        lighting, total = self.scene.lighting, np.zeros_like(places[0].origins_m)
        for at in places:
            lamps = lamps_on(lighting, self.transport, at.origins_m, at)
            total += lamp_light(lamps, at)
        return total / np.float32(len(places))

    def _focused(self, emitters: Emitters, places: list[Points], shifts: Floats) -> Emitters:
        """Emitters chosen by their light at these points."""
        tried = slice(None, None, _TRIED_PATCHES)
        at = Points(*(values[tried] for values in places[0]))
        return emitters.focused(self.transport, at, shifts[tried])

    def _aimed(self, emitters: Emitters, places: list[Points], shifts: Floats) -> Floats:
        """Light (n, 2, 3) of emitters, in two halves of the rays aimed at them.

        The rays are divided among the sets of points.
        """
        total = np.zeros((len(shifts), 2, 3), dtype=np.float32)
        points = spread_points(emitters.aimed)
        for number, at in enumerate(places):
            for half in (0, 1):
                part = points[half::2][number :: len(places)]
                if len(part):
                    total[:, half] += emitters.light(self.transport, at, part, shifts)
        return total

    def _solve(self, direct: Arrays) -> Floats:
        """Radiosity (p, 3) after all bounces but the last, along the links."""
        links, shares = direct["links"], direct.get("shares")
        first = direct["lamps"] + direct["other"]
        if self.settings.bounces == 0:
            return np.zeros_like(self.patches.albedo)
        numbers = np.maximum((links != INSIDE).sum(axis=1), 1)[:, None].astype(np.float32)
        radiosity = self._scattered(first)
        for _ in range(self.settings.bounces - 1):
            padded = np.concatenate((radiosity, np.zeros((2, 3), np.float32)))  # SKY, INSIDE
            bounced = np.zeros_like(radiosity)
            for link in range(links.shape[1]):
                light = padded[links[:, link]]
                bounced += light if shares is None else light * shares[:, link]
            radiosity = self._scattered(first + bounced / numbers)
        return radiosity

    def _scattered(self, light: Floats) -> Floats:
        """Radiosity (p, 3) of patches in light (p, 3), also through frosted glass."""
        patches = self.patches
        radiosity: Floats = patches.albedo * light
        some = np.flatnonzero(patches.transmitted.any(axis=1) & (patches.opposite != NO_PATCH))
        radiosity[some] += patches.transmitted[some] * light[patches.opposite[some]]
        return radiosity

    def _gather(self, tile: int, radiosity: Floats, emitters: Emitters) -> Arrays:
        first, last = self._range(tile)
        count = last - first
        light = np.zeros((count, 3), dtype=np.float32)
        halves = np.zeros((count, 2, 3), dtype=np.float32)
        is_valid = np.zeros(count, dtype=np.bool_)
        some, places = self._places(first, last)
        if len(some):
            random = generator(self.settings.seed, _GATHER, tile)
            shifts = random.random((count, 6), dtype=np.float32)[some]
            focused = self._focused(emitters, places, shifts[:, 4:])
            gathered = self.gatherer.gather(places, shifts[:, :2], radiosity, focused)
            aimed = self._aimed(focused, places, shifts[:, 2:4])
            light[some] = gathered.light + aimed.sum(axis=1)
            halves[some] = gathered.halves + 2.0 * aimed
            is_valid[some] = gathered.is_valid
        return {"light": light, "halves": halves, "is_valid": is_valid}


def _joined(tiles: Iterator[Arrays]) -> Arrays:
    arrays = list(tiles)
    return {key: np.concatenate([one[key] for one in arrays]) for key in arrays[0]}


# Closed parts of meshes, which count as solids: their inside is invisible.


def hollow_triangles(scene: Scene) -> NDArray[np.bool_]:
    """Mask (m,) of triangles with a visible back: double-sided, and not part of a solid.

    A solid is a closed part of a mesh without a start position of a camera inside. Frosted glass is
    lit from its back, also if it is closed or single-sided.
    """
    parts = {one: _closed_parts(scene.meshes[one]) for one in {i.mesh for i in scene.instances}}
    places = [scene.start.position_m, *(start.position_m for start in scene.starts)]
    hollow = [np.empty(0, np.bool_)]
    for instance in scene.instances:
        part_of, closed = parts[instance.mesh]
        mesh = scene.meshes[instance.mesh]
        material = scene.materials[mesh.material]
        if material.frosted_transmission > 0.0 and not scene.lighting.is_matte:
            hollow.append(np.ones(len(part_of), dtype=np.bool_))
            continue
        if not material.double_sided:
            hollow.append(np.zeros(len(part_of), dtype=np.bool_))
            continue
        corners = mesh.positions.astype(np.float64) @ instance.world_from_mesh[:3, :3].T
        corners = (corners + instance.world_from_mesh[:3, 3])[mesh.triangles]
        low, high = (np.full((len(closed), 3), sign * np.inf) for sign in (1, -1))
        np.minimum.at(low, part_of, corners.min(axis=1))
        np.maximum.at(high, part_of, corners.max(axis=1))
        holds = np.zeros(len(closed), dtype=np.bool_)
        for place in places:
            holds |= ((low < place) & (high > place)).all(axis=1)
        hollow.append(~(closed & ~holds)[part_of])
    return np.concatenate(hollow)


def instances_of(scene: Scene, is_chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask (n,) of instances with at least one chosen triangle of (m,)."""
    counts = [len(scene.meshes[instance.mesh].triangles) for instance in scene.instances]
    ends = np.cumsum([0, *counts])
    before = np.concatenate(([0], np.cumsum(is_chosen)))
    return before[ends[1:]] > before[ends[:-1]]


def _closed_parts(mesh: Mesh) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Connected part (m,) of each triangle, and mask of closed parts: two triangles per edge."""
    _, welded = np.unique(mesh.positions, axis=0, return_inverse=True)
    corners = welded.reshape(-1)[mesh.triangles]
    count = int(corners.max(initial=-1)) + 1
    firsts, seconds = corners[:, [0, 1, 2]].ravel(), corners[:, [1, 2, 0]].ravel()
    ones = np.ones(len(firsts), dtype=np.int8)
    _, part_of_vertex = connected_components(
        coo_matrix((ones, (firsts, seconds)), shape=(count, count)), directed=False
    )
    part_of = part_of_vertex[corners[:, 0]].astype(np.intp)
    # in a closed part, each edge is traversed equally often in both directions
    keys, reverse = firsts.astype(np.int64) * count + seconds, seconds * np.int64(count) + firsts
    edges, of_both = np.unique(np.concatenate((keys, reverse)), return_inverse=True)
    balance = np.zeros(len(edges), dtype=np.intp)
    np.add.at(balance, of_both.reshape(-1)[: len(keys)], 1)
    np.add.at(balance, of_both.reshape(-1)[len(keys) :], -1)
    is_open = balance[of_both.reshape(-1)[: len(keys)]] != 0
    closed = np.ones(int(part_of.max(initial=-1)) + 1, dtype=np.bool_)
    closed[np.repeat(part_of, 3)[is_open]] = False
    return part_of, closed


# Estimate of the time of a bake, from some of its tiles.


_PROBED_TILES = 2  # per thread


def estimate(bake: Bake, jobs: int | None = None) -> str:
    """Time and size of a bake as text, measured on some of its tiles.

    Args:
        bake: bake to estimate.
        jobs: number of threads; None: one per core.
    """
    threads = jobs or os.cpu_count() or 1
    probes = bake.prober(bake.patches.emission)
    seconds = _seconds(bake.try_tile, bake.tiles, threads)
    seconds += _seconds(probes.bake, probes.tiles, threads)
    width, height = bake.atlas.size_px
    duration = f"{seconds:.0f} seconds" if seconds < 100.0 else f"{seconds / 60.0:.0f} minutes"
    return f"about {duration} for {width} × {height} texels of {bake.texel_m:g} m"


def _seconds(compute: Callable[[int], object], tiles: int, threads: int) -> float:
    """Time of all tiles, extrapolated from evenly spread ones."""
    count = min(tiles, _PROBED_TILES * threads)
    begin_s = time.monotonic()
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(compute, ((2 * at + 1) * tiles // (2 * count) for at in range(count))):
            pass
    return (time.monotonic() - begin_s) * tiles / max(count, 1)
