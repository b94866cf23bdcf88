"""Baking of a scene's light, in tiles: on its surfaces, and in free space."""

from __future__ import annotations

import io
import json
import os
import shutil
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write, write_text
from omnisim.core.files.number_files import read_arrays
from omnisim.rendering.baking.denoising import TexelSurfaces, denoised
from omnisim.rendering.baking.emitters import (
    LUMINANCE,
    Emitters,
    Gatherer,
    Points,
    generator,
    lamp_light,
    lamps_on,
    points_at,
    sphere_directions,
    spread_points,
    usable,
)
from omnisim.rendering.baking.lightmap_atlas import automatic_atlas, build_atlas, camera_places_m
from omnisim.rendering.baking.patches import NO_PATCH, Patches, build_patches
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.rendering.baking.specular import SpecularSurfaces
from omnisim.rendering.baking.transport import INSIDE, SKY, Transport
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.scene.light.environment import factors_of_moments, spherical_harmonics
from omnisim.scene.model import Mesh, Scene
from omnisim.scene.surface_kind import SurfaceKind, kind_of

TILE = 4096  # patches
_LINKS = 32  # rays per patch, along which all bounces but the last are computed
_AIMED_LINKS = 16  # rays to emitters
_MAX_PLACES = 32
_BRIGHT = 4.0  # times the mean: rays are aimed at patches that reflect more
_MAX_HALF = 6e4  # within half floats
_TRIED_PATCHES = 8  # one in 8 patches is tried to choose the lights to aim at
_DIRECT, _GATHER = range(2)  # stages of random numbers


class BakedPatches(NamedTuple):
    """Light on the patches of a scene."""

    patches: Patches  # patches of the scene
    lamps: Floats32  # (p, 3) light of lamps
    gathered: Floats32  # (p, 3) all other light
    halves: Floats32  # (p, 2, 3) the same from the even and the odd rays, separately
    radiosity: Floats32  # (p, 3) reflected light
    is_valid: Bools  # (p,) the patch has light


class Bake:
    """Bake of a scene, tile by tile.

    Args:
        scene: scene to bake; its dynamic objects are ignored.

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
        # rays are aimed at patches that emit, or reflect far more light than the mean
        luminance, areas_m2 = radiosity @ LUMINANCE, self.patches.areas_m2
        mean = np.sum(luminance * areas_m2) / max(float(areas_m2.sum()), 1e-30)
        bright: Bools = luminance > _BRIGHT * mean
        bright |= np.any(self.patches.emission > 0.0, axis=1)
        lights = np.where(bright[:, None], radiosity + self.patches.emission, np.float32(0.0))
        samples = self.settings.samples
        emitters = self._emitters(lights, max(8, samples // 4 * 2), samples)
        others = np.where(bright[:, None], np.float32(0.0), radiosity)

        gather = partial(self._gather, radiosity=others, emitters=emitters)
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

    def light(self, baked: BakedPatches) -> Floats32:
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
        return baker.grid, {
            key: tile.reshape(*shape, *tile.shape[1:]) for key, tile in tiles.items()
        }

    def prober(self, seen: Floats32) -> ProbeBaker:
        """Baker of the probes, from the light (p, 3) that leaves the patches."""
        return ProbeBaker(self.scene, self.transport, self.gatherer, seen, self.settings.seed)

    def surfaces(self, is_valid: Bools) -> TexelSurfaces:
        """Surfaces at the patches, at the first sample of each."""
        positions, normals = np.zeros((2, self.patches.count, 3), dtype=np.float32)
        for tile in range(self.tiles):
            first, last = self._range(tile)
            some, places = self._places(first, last)
            if len(some):
                positions[first + some] = places[0].origins_m
                normals[first + some] = places[0].normals
        return TexelSurfaces(positions, normals, is_valid)

    def _emitters(self, emission: Floats32, aimed: int, gathered: int) -> Emitters:
        return Emitters(self.patches, self._points, emission, aimed, gathered)

    def _range(self, tile: int) -> tuple[int, int]:
        return tile * TILE, min((tile + 1) * TILE, self.patches.count)

    def _places(self, first: int, last: int) -> tuple[Indices, list[Points]]:
        """Patches with samples in a range, and sets of points, one per patch, used in turn."""
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
            for at in places:
                on_lit = lamps_on(self.scene.lighting, self.transport, at.origins_m, at)
                lamps[some] += lamp_light(on_lit, at)
            lamps[some] /= np.float32(len(places))
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

    def _focused(self, emitters: Emitters, places: list[Points], shifts: Floats32) -> Emitters:
        """Emitters chosen by their light at these points."""
        tried = slice(None, None, _TRIED_PATCHES)
        at = Points(*(values[tried] for values in places[0]))
        return emitters.focused(self.transport, at, shifts[tried])

    def _aimed(self, emitters: Emitters, places: list[Points], shifts: Floats32) -> Floats32:
        """Light (n, 2, 3) of two halves of the rays aimed at emitters, divided among the places."""
        total = np.zeros((len(shifts), 2, 3), dtype=np.float32)
        points = spread_points(emitters.aimed)
        for number, at in enumerate(places):
            for half in (0, 1):
                part = points[half::2][number :: len(places)]
                if len(part):
                    total[:, half] += emitters.light(self.transport, at, part, shifts)
        return total

    def _solve(self, direct: Arrays) -> Floats32:
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

    def _scattered(self, light: Floats32) -> Floats32:
        """Radiosity (p, 3) of patches in light (p, 3), also through frosted glass."""
        patches = self.patches
        radiosity: Floats32 = patches.albedo * light
        some = np.flatnonzero(patches.transmitted.any(axis=1) & (patches.opposite != NO_PATCH))
        radiosity[some] += patches.transmitted[some] * light[patches.opposite[some]]
        return radiosity

    def _gather(self, tile: int, radiosity: Floats32, emitters: Emitters) -> Arrays:
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
    return {key: np.concatenate([array[key] for array in arrays]) for key in arrays[0]}


def hollow_triangles(scene: Scene) -> Bools:
    """Mask (m,) of triangles with a visible back: double-sided, and not part of a solid.

    A solid is a closed part of a mesh without a start position of a camera inside. Frosted glass is
    lit from its back, also if it is closed or single-sided.
    """
    parts = {mesh: _closed_parts(scene.meshes[mesh]) for mesh in {i.mesh for i in scene.instances}}
    places = [scene.start.position_m, *(start.position_m for start in scene.starts)]
    hollow = [np.empty(0, np.bool_)]
    for instance in scene.instances:
        part_of, closed = parts[instance.mesh]
        mesh = scene.meshes[instance.mesh]
        material = scene.materials[mesh.material]
        if kind_of(material, scene.lighting.is_matte) & SurfaceKind.FROSTED:
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


def instances_of(scene: Scene, is_chosen: Bools) -> Bools:
    """Mask (n,) of instances with at least one chosen triangle of (m,)."""
    counts = [len(scene.meshes[instance.mesh].triangles) for instance in scene.instances]
    ends = np.cumsum([0, *counts])
    before = np.concatenate(([0], np.cumsum(is_chosen)))
    return before[ends[1:]] > before[ends[:-1]]


def _closed_parts(mesh: Mesh) -> tuple[Indices, Bools]:
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
    """Time and size of a bake as text, measured on some of its tiles by `jobs` threads."""
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


# Probes: light in free space, for dynamic objects.
PROBE_BUDGET = 16384
PROBE_TILE = 1024
_MIN_SPACING_M, _MIN_SIZE_M = 0.25, 1e-3
# Extents around cameras: the first with a small enough spacing is taken, else the last.
_MAX_SPACING_M = 0.6
_AROUND_M = ((np.inf, np.inf), (32.0, 16.0), (16.0, 8.0), (8.0, 4.0))  # level, upwards
_RAYS = 256
_MAX_INSIDE = 0.25  # share of rays that hit backs
_PROBES = 2  # stage of random numbers


class ProbeGrid(NamedTuple):
    """Grid of probes in the world."""

    # (3,) first probe, and spacing of neighbors
    origin_m: Floats
    spacing_m: Floats
    shape: tuple[int, int, int]  # number of probes along x, y and z

    @property
    def size(self) -> int:
        """Number of probes."""
        return int(np.prod(self.shape))

    def positions_m(self, first: int, last: int) -> Floats:
        """Positions (n, 3) of the probes from index `first` up to `last`, z fastest."""
        indices = np.stack(np.unravel_index(np.arange(first, last), self.shape), axis=1)
        return self.origin_m + indices * self.spacing_m


def probe_grid(scene: Scene) -> ProbeGrid:
    """Grid of probes within the bounds of the static surfaces, about `PROBE_BUDGET` or fewer.

    In a larger scene the grid surrounds the positions of cameras and vehicles.
    """
    low, high = scene.bounds_m()
    places = camera_places_m(scene)
    for level_m, upwards_m in _AROUND_M:
        around = np.array((level_m, level_m, upwards_m))
        first = np.maximum(low, places.min(axis=0) - around)
        last = np.minimum(high, places.max(axis=0) + around)
        spacing_m = _MIN_SPACING_M
        while True:
            shape = np.maximum(np.ceil((last - first) / spacing_m).astype(np.intp), 1)
            if shape.prod(dtype=np.float64) <= PROBE_BUDGET:  # would overflow as int64
                break
            spacing_m *= 1.05
        if spacing_m <= _MAX_SPACING_M:
            break
    steps = np.maximum(last - first, _MIN_SIZE_M) / shape
    nx, ny, nz = (int(number) for number in shape)
    return ProbeGrid(first + 0.5 * steps, steps, (nx, ny, nz))


class ProbeBaker:
    """Bakes probes with rays in all directions; `seen`: (p, 3) light leaving the patches."""

    def __init__(
        self, scene: Scene, transport: Transport, gatherer: Gatherer, seen: Floats32, seed: int
    ):
        self.grid = probe_grid(scene)
        self.tiles = -(-self.grid.size // PROBE_TILE)
        self._lighting, self._transport, self._gatherer = scene.lighting, transport, gatherer
        self._seen, self._seed = seen, seed

    def bake(self, tile: int) -> Arrays:
        """Spherical harmonics (n, 9, 3) and validity (n,) of a tile's probes."""
        first, last = tile * PROBE_TILE, min((tile + 1) * PROBE_TILE, self.grid.size)
        positions = self.grid.positions_m(first, last) - self._transport.center_m
        origins = positions.astype(np.float32)
        shift = generator(self._seed, _PROBES, tile).random(2, dtype=np.float32)
        directions = sphere_directions((spread_points(_RAYS) + shift) % 1.0)
        moments = np.zeros((len(origins), 9, 3))
        inside = np.zeros(len(origins), dtype=np.intp)
        for direction, shares in zip(directions, spherical_harmonics(directions), strict=True):
            aims = np.broadcast_to(direction, origins.shape)
            hits = self._transport.cast(origins, np.ascontiguousarray(aims))
            inside += (hits.patches == INSIDE) | self._transport.is_back(hits)
            light = self._seen[np.maximum(hits.patches, 0)]
            light[hits.patches < 0] = 0.0
            free = np.flatnonzero(hits.patches == SKY)
            light[free] = self._gatherer.sky(hits.directions[free])
            light *= hits.shares
            moments += shares[:, None] * light[:, None]
        moments *= 4.0 * np.pi / _RAYS
        for lamp in lamps_on(self._lighting, self._transport, origins):
            toward = np.broadcast_to(lamp.directions, origins.shape)
            light = np.pi * lamp.levels[:, None] * lamp.color
            moments += spherical_harmonics(toward)[:, :, None] * light[:, None]
        return {
            "sh": factors_of_moments(moments).astype(np.float32),
            "valid": inside <= _MAX_INSIDE * _RAYS,
        }


# Tiles of unfinished bakes, as files: an interrupted bake resumes from them.
Arrays = dict[str, NDArray[Any]]
Progress = Callable[[str, int], Callable[[Iterable[int]], Iterable[int]]]


def no_progress(description: str, total: int) -> Callable[[Iterable[int]], Iterable[int]]:
    """Progress without display."""
    return lambda steps: steps


def write_arrays(file: IO[bytes], arrays: Arrays, is_compressed: bool = False) -> None:
    """Write arrays as NumPy's .npz; equal arrays make equal bytes."""
    kind = zipfile.ZIP_DEFLATED if is_compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(file, "w", kind) as archive:
        for name, values in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(values), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy")
            info.compress_type = kind
            archive.writestr(info, buffer.getvalue())


class TileFolder:
    """Folder of the finished tiles, beside the bake.

    Args:
        plan: everything that determines the tiles; tiles of another plan are removed.

    Raises:
        OutputError: the folder cannot be written.
    """

    def __init__(self, output: Path, plan: Mapping[str, object]):
        self.path = output.resolve().with_name(f".{output.name}.unfinished")
        text = json.dumps(plan, sort_keys=True) + "\n"
        plan_path = self.path / "plan.json"
        try:
            if not plan_path.is_file() or plan_path.read_text(encoding="utf-8") != text:
                self.remove()
                self.path.mkdir(parents=True)
                write_text(plan_path, text)
        except OSError as reason:
            raise OutputError(f"{self.path}: cannot be written: {reason.strerror}") from None

    def remove(self) -> None:
        """Remove all tiles."""
        shutil.rmtree(self.path, ignore_errors=True)

    def load(self, name: str) -> Arrays | None:
        """Arrays of a tile; None: not computed yet."""
        path = self.path / f"{name}.npz"
        if not path.is_file():
            return None
        return read_arrays(path, OutputError, "a tile of a bake", f"remove {self.path}")

    def store(self, name: str, arrays: Arrays) -> None:
        """Store the arrays of a tile.

        Raises:
            OutputError: the file cannot be written.
        """
        with atomic_write(self.path / f"{name}.npz") as partial, partial.open("wb") as file:
            write_arrays(file, arrays)


def in_tiles(
    folder: TileFolder,
    stage: str,
    compute: Callable[[int], Arrays],
    count: int,
    jobs: int | None,
    progress: Progress,
) -> Iterator[Arrays]:
    """Arrays of tiles, in order: loaded if finished, otherwise computed in threads."""

    def one(number: int) -> Arrays:
        name = f"{stage}-{number:05d}"
        arrays = folder.load(name)
        if arrays is None:
            arrays = compute(number)
            folder.store(name, arrays)
        return arrays

    pool = ThreadPoolExecutor(jobs or os.cpu_count() or 1)
    try:
        results = pool.map(one, range(count))
        for _ in progress(stage, count)(range(count)):
            yield next(results)
    finally:
        pool.shutdown(cancel_futures=True)
