"""Reader of baked light folders, as written by `omnisim bake`.

A folder belongs to one scene in one lighting, identified by its fingerprint.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

from omnisim.core.arrays import Floats32
from omnisim.core.errors import OutputError, SceneError
from omnisim.core.files.image_files import read_radiance
from omnisim.core.files.number_files import read_arrays
from omnisim.core.files.parameters import Point, Positive, Table, parse_table
from omnisim.core.files.sources import SourceReader
from omnisim.scene.light.baked_light import FACTORS, MAX_HALF, BakedLight, Probes
from omnisim.scene.light.lighting import DEFAULT_LIGHTING, background_light, is_bright
from omnisim.scene.model import Mesh, Scene
from omnisim.scene.parts import LightRectangle

CONTENTS, IRRADIANCE = "baked.json", "irradiance.exr"
UNWRAPPING, PROBES = "unwrapping.npz", "probes.npz"
MAX_SIZE_PX, MAX_PROBES = 16384, 1_000_000
_EXPECTED = "expected the file that `omnisim bake` wrote"
_TOLERANCE = 1e-4  # for rectangles and for coordinates within them

Share = Annotated[float, Field(strict=True, ge=-_TOLERANCE, le=1.0 + _TOLERANCE)]
Count = Annotated[int, Field(strict=True, ge=1, le=4096)]


class _OpenTable(Table):
    """Table that permits additional keys, which are informational."""

    model_config = ConfigDict(extra="ignore")


class _Grid(_OpenTable):
    origin_m: Point
    spacing_m: tuple[Positive, Positive, Positive]
    shape: tuple[Count, Count, Count]


class _Contents(_OpenTable):
    version: Literal[1]
    fingerprint: str
    rects: dict[str, tuple[Share, Share, Share, Share]]
    back_rects: dict[str, tuple[Share, Share, Share, Share]] = Field(default_factory=dict)
    probes: _Grid


def with_baked_light(
    scene: Scene, folder: Path, reader: SourceReader | None = None, light: str | None = None
) -> Scene:
    """Scene with the baked light of a folder; the scene must be loaded without baked light.

    A scene without lamps and with bright emissive surfaces keeps no even light, which would show in
    gloss: the bake has none. Meshes are split at the seams of their unwrapping; triangles keep
    their order.

    `light` is the digest of the inputs of the scene's light; None: that of its identity.

    Raises:
        SceneError: the light belongs to another scene, or a file is missing or damaged.
    """
    if not folder.is_dir():
        raise SceneError(f"{folder}: no such folder: {_advice(scene, folder)}")
    reader = reader or SourceReader()
    contents = _read_contents(folder / CONTENTS, reader)
    own = contents.fingerprint
    # older versions identified loaded scenes by their arrays, too
    if own != (light or scene.identity.light) and own != scene.light_of_arrays:
        raise SceneError(
            f"{folder}: the bake does not match {scene.name}: geometry or lights have changed "
            f"since: {_advice(scene, folder, ' --force')}"
        )
    rectangles = _rectangles(contents.rects, "rects", scene, folder / CONTENTS)
    backs = _rectangles(contents.back_rects, "back_rects", scene, folder / CONTENTS)
    baked = BakedLight(
        _read_irradiance(reader.note(folder / IRRADIANCE)),
        _read_probes(reader.note(folder / PROBES), folder / CONTENTS, contents.probes),
    )
    lighting = without_even_light(scene).lighting
    meshes, path = list(scene.meshes), folder / UNWRAPPING
    stored = _read_unwrapping(reader.note(path))
    for number in sorted({scene.instances[number].mesh for number in rectangles}):
        meshes[number] = _split_mesh(meshes[number], number, stored, path)
    return dataclasses.replace(
        scene,
        meshes=tuple(meshes),
        instances=tuple(
            dataclasses.replace(
                instance, light_rectangle=rectangles[number], light_back_rectangle=backs.get(number)
            )
            if number in rectangles
            else instance
            for number, instance in enumerate(scene.instances)
        ),
        lighting=dataclasses.replace(lighting, baked=baked),
    )


def without_even_light(scene: Scene) -> Scene:
    """Scene lit by its emissive surfaces alone, if it has no lamps and they are bright.

    A background brighter than white counts too: it is the sky outside.
    """
    lighting = scene.lighting
    is_even = lighting.lights is DEFAULT_LIGHTING.lights and not lighting.is_matte
    if not (is_even and any(map(is_bright, scene.materials))):
        return scene
    sky = background_light(scene.background)
    shone = dataclasses.replace(lighting, lights=(), ambient=sky)
    return dataclasses.replace(scene, lighting=shone)


def _advice(scene: Scene, folder: Path, more: str = "") -> str:
    return f"run `omnisim bake {scene.name} -o {folder}{more}`"


def _read_contents(path: Path, reader: SourceReader) -> _Contents:
    try:
        content = json.loads(reader.read(path))
    except OSError as reason:
        raise SceneError(f"{path}: cannot be read: {reason.strerror}: {_EXPECTED}") from None
    except (ValueError, RecursionError):
        raise SceneError(f"{path}: is damaged: not JSON: {_EXPECTED}") from None
    if not isinstance(content, dict):
        raise SceneError(f"{path}: is damaged: {_EXPECTED}")
    try:
        return parse_table(content, _Contents, SceneError, str(path))
    except SceneError as faults:  # the first is enough: nobody repairs such a file by hand
        raise SceneError(str(faults).partition("\n")[0]) from None


def _rectangles(
    rects: dict[str, LightRectangle], key: str, scene: Scene, path: Path
) -> dict[int, LightRectangle]:
    """Lightmap regions by instance index, for rigid instances with a non-empty region."""
    rectangles, instances = {}, len(scene.instances)
    for name, rectangle in rects.items():
        left, top, width, height = rectangle
        if not (name.isascii() and name.isdigit() and len(name) < 10 and int(name) < instances):
            raise SceneError(
                f"{path}: {key}: expected numbers of instances, up to {instances - 1}, got {name!r}"
            )
        if left + width > 1.0 + _TOLERANCE or top + height > 1.0 + _TOLERANCE:
            raise SceneError(f"{path}: {key}.{name} = {list(rectangle)}: expected it within 0 to 1")
        is_rigid = scene.meshes[scene.instances[int(name)].mesh].deformation is None
        if width > 0.0 and height > 0.0 and is_rigid:
            rectangles[int(name)] = rectangle
    return rectangles


def _read_irradiance(path: Path) -> NDArray[np.float16]:
    try:
        pixels = read_radiance(path)
    except OutputError as reason:
        raise SceneError(str(reason)) from None
    height, width = pixels.shape[:2]
    if max(height, width) > MAX_SIZE_PX:
        raise SceneError(f"{path}: expected at most {MAX_SIZE_PX} px, got {width} × {height}")
    if not ((pixels >= 0.0) & (pixels <= MAX_HALF)).all():
        raise SceneError(f"{path}: expected light from 0 to {MAX_HALF:g}")
    return pixels.astype(np.float16)


def _read_probes(path: Path, contents: Path, grid: _Grid) -> Probes:
    shape = grid.shape
    if np.prod(shape, dtype=np.float64) > MAX_PROBES:
        raise SceneError(
            f"{contents}: probes.shape = {list(shape)}: expected at most {MAX_PROBES} probes"
        )
    stored = read_arrays(path, SceneError, "an archive", _EXPECTED, ("sh", "valid"))
    factors = _array(stored, "sh", "f", (*shape, FACTORS, 3), path)
    valid = _array(stored, "valid", "b", shape, path)
    if not (np.abs(factors[valid]) <= MAX_HALF).all():
        raise SceneError(f"{path}: sh: expected finite numbers up to {MAX_HALF:g}")
    return Probes(
        np.array(grid.origin_m), np.array(grid.spacing_m),
        np.where(valid[..., None, None], factors, 0.0).astype(np.float32), valid,
    )  # fmt: skip


def _read_unwrapping(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays of the meshes, keyed by array name and mesh index."""
    names = {"meshes", "vertex_of", "triangles", "uv"}
    stored = read_arrays(path, SceneError, "an archive", _EXPECTED, names)
    meshes = _array(stored, "meshes", "iu", (None, 3), path).astype(np.int64)
    arrays = {}
    for key, kinds, width, column in (
        ("vertex_of", "iu", (), 1), ("triangles", "iu", (3,), 2), ("uv", "f", (2,), 1)
    ):  # fmt: skip
        ends = np.cumsum(meshes[:, column])
        joined = _array(stored, key, kinds, (None, *width), path)
        if (meshes < 0).any() or ends[-1:].sum() != len(joined):
            raise SceneError(
                f"{path}: meshes: expected numbers of {len(joined)} in all, as {key} has"
            )
        for mesh, part in zip(meshes[:, 0], np.split(joined, ends[:-1]), strict=True):
            arrays[f"{key} of mesh {mesh}"] = part
    return arrays


def _split_mesh(mesh: Mesh, number: int, stored: dict[str, NDArray[Any]], path: Path) -> Mesh:
    vertex_of = _array(stored, f"vertex_of of mesh {number}", "iu", (None,), path)
    triangles = _array(stored, f"triangles of mesh {number}", "iu", mesh.triangles.shape, path)
    places = _array(stored, f"uv of mesh {number}", "f", (len(vertex_of), 2), path)
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < len(vertex_of)):
        raise SceneError(
            f"{path}: triangles of mesh {number}: expected vertices from 0 to {len(vertex_of) - 1}"
        )
    if not np.array_equal(vertex_of[triangles], mesh.triangles):
        raise SceneError(
            f"{path}: vertex_of of mesh {number}: expected the scene's triangles, got others"
        )
    if not ((places >= -_TOLERANCE) & (places <= 1.0 + _TOLERANCE)).all():
        raise SceneError(f"{path}: uv of mesh {number}: expected coordinates from 0 to 1")
    if len(vertex_of) and not (vertex_of.min() >= 0 and vertex_of.max() < len(mesh.positions)):
        raise SceneError(
            f"{path}: vertex_of of mesh {number}: expected vertices from 0 to "
            f"{len(mesh.positions) - 1}"
        )
    return dataclasses.replace(
        mesh,
        positions=mesh.positions[vertex_of],
        triangles=triangles.astype(np.uint32),
        normals=_taken(mesh.normals, vertex_of),
        texture_coordinates=_taken(mesh.texture_coordinates, vertex_of),
        colors=_taken(mesh.colors, vertex_of),
        second_texture_coordinates=_taken(mesh.second_texture_coordinates, vertex_of),
        light_coordinates=places.astype(np.float32),
    )


def _taken(values: Floats32 | None, vertices: NDArray[np.integer[Any]]) -> Floats32 | None:
    return None if values is None else values[vertices]


def _array(
    stored: dict[str, NDArray[Any]],
    name: str,
    kinds: str,
    shape: tuple[int | None, ...],
    path: Path,
) -> NDArray[Any]:
    """Array of an archive, after a check of kind and shape; None in `shape` allows any length."""
    if name not in stored:
        raise SceneError(f"{path}: {name}: missing: {_EXPECTED}")
    array = stored[name]
    fits = array.ndim == len(shape) and all(
        expected in (None, got) for expected, got in zip(shape, array.shape, strict=True)
    )
    if array.dtype.kind not in kinds or not fits:
        expected = " × ".join("n" if size is None else str(size) for size in shape)
        raise SceneError(
            f"{path}: {name}: expected {expected} {_KINDS[kinds]}, "
            f"got {array.dtype} of shape {array.shape}"
        )
    return array


_KINDS = {"f": "floats", "b": "flags", "iu": "whole numbers"}
