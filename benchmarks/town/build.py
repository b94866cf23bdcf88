"""Houses, trees and lamps on their plots, merged into meshes per block."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.errors import BenchmarkError
from benchmarks.town.house import KINDS, house
from benchmarks.town.land import START_X_M, Plots, land
from benchmarks.town.materials import town_materials
from benchmarks.town.mesh_builder import MeshBuilder, Submesh
from benchmarks.town.street import GARDEN_M, KERB_HIGH_M, KERB_M, ROAD_MIDDLE_M, ground, lamp, tree
from omnisim.scene.model import Instance, Light, Lighting, LightKind, Mesh, Scene, StartPose

EYE_M = 1.2  # above the pavement
OUTSKIRTS_M = 150.0
BACKGROUND = (0.45, 0.62, 0.85)
_SUN = Light(LightKind.DIRECTIONAL, (1.0, 0.94, 0.84), 0.75, direction=np.array([0.45, 0.6, -0.66]))
LIGHTING = Lighting(ambient=(0.42, 0.46, 0.52), lights=(_SUN,))


class _Placements(NamedTuple):
    """Parts of an object, and the poses of its copies in the town."""

    parts: dict[str, Submesh]
    world_from_object: NDArray[np.float64]  # (n, 3, 3), turned and scaled
    position_m: NDArray[np.float64]  # (n, 3)
    block: NDArray[np.intp]  # (n,)


def build_town(triangles: int) -> Scene:
    """Town whose number of triangles is nearest to `triangles`.

    The effective viewpoint starts in the middle of a street along x, where towns of all sizes look
    the same.

    Raises:
        BenchmarkError: more triangles than the land has room for, or far fewer than a house has.
    """
    houses = [house(kind) for kind in KINDS]
    around, lamp_parts, tree_parts = ground(), lamp(), tree()
    plots = land()
    kind_of_plot = np.minimum((plots.random[:, 0] * len(KINDS)).astype(int), len(KINDS) - 1)
    beside = sum(map(_count, (around, lamp_parts, tree_parts)))
    total = np.cumsum(np.array([_count(parts) + beside for parts in houses])[kind_of_plot])
    if not total[0] // 2 <= triangles <= total[-1]:
        raise BenchmarkError(
            f"town: expected {total[0] // 2} to {total[-1]} triangles, got {triangles}"
        )
    plots = plots.first(1 + int(np.argmin(np.abs(total - triangles))))
    kind_of_plot = kind_of_plot[: len(plots)]
    facing, at, block = plots.house_from_plot, plots.position_m, plots.block
    objects = [_Placements(around, facing, at, block)]
    for index, parts in enumerate(houses):
        of_kind = kind_of_plot == index
        objects.append(_Placements(parts, facing[of_kind], at[of_kind], block[of_kind]))
    lamp_m = facing @ (4.5, KERB_M + 0.4, 0.0)
    objects.append(_Placements(lamp_parts, facing, at + lamp_m, block))
    objects.append(_Placements(tree_parts, *_trees(plots), block))
    return _scene(objects, plots)


def _trees(plots: Plots) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations with scale (n, 3, 3) and positions (n, 3) of trees in the front gardens."""
    x, y, angle, size = plots.random[:, 1:].T
    spot = np.stack((x - 4.6, y + GARDEN_M + 2.0, np.zeros(len(plots))), axis=-1)
    rotations = np.zeros((len(plots), 3, 3))
    rotations[:, 0, 0] = rotations[:, 1, 1] = np.cos(2.0 * np.pi * angle)
    rotations[:, 1, 0] = np.sin(2.0 * np.pi * angle)
    rotations[:, 0, 1] = -rotations[:, 1, 0]
    rotations[:, 2, 2] = 1.0
    grown = rotations * (0.8 + 0.5 * size)[:, None, None]
    return grown, plots.position_m + np.einsum("nij,nj->ni", plots.house_from_plot, spot)


def _scene(objects: list[_Placements], plots: Plots) -> Scene:
    materials = town_materials()
    number = {name: at for at, name in enumerate(materials)}
    meshes: list[Mesh] = []
    instances: list[Instance] = []

    def add(node: str, origin_m: NDArray[np.float64], parts: dict[str, list[Submesh]]) -> None:
        world_from_mesh = np.eye(4)
        world_from_mesh[:3, 3] = origin_m
        for name, found in parts.items():
            instances.append(Instance(node, len(meshes), world_from_mesh))
            meshes.append(_mesh(name, number[name], materials[name][1], found))

    for block in range(1 + int(plots.block.max())):
        origin_m = plots.position_m[plots.block == block].mean(axis=0)
        parts: dict[str, list[Submesh]] = {}
        for item in objects:
            in_block = item.block == block
            if in_block.any():
                at_m = item.position_m[in_block] - origin_m
                for name, part in item.parts.items():
                    placed = _placed(part, item.world_from_object[in_block], at_m)
                    parts.setdefault(name, []).append(placed)
        add(f"block_{block:04d}", origin_m, parts)
    add("outskirts", np.zeros(3), {name: [part] for name, part in _outskirts(plots).items()})
    return Scene(
        name="town",
        meshes=tuple(meshes),
        materials=tuple(material for material, _ in materials.values()),
        instances=tuple(instances),
        lighting=LIGHTING,
        background=BACKGROUND,
        start=StartPose((START_X_M, 0.0, EYE_M)),
    )


def _placed(
    part: Submesh, world_from_object: NDArray[np.float64], position_m: NDArray[np.float64]
) -> Submesh:
    """Copies of a part at n poses, each with its own vertices."""
    count, vertices = len(position_m), len(part.positions)
    positions = part.positions @ world_from_object.transpose(0, 2, 1).astype(np.float32)
    positions += position_m[:, None].astype(np.float32)
    first = (vertices * np.arange(count, dtype=np.uint32))[:, None, None]
    return Submesh(
        positions.reshape(-1, 3),
        np.tile(part.texture_coordinates, (count, 1)),
        (part.triangles + first).reshape(-1, 3),
    )


def _mesh(name: str, material: int, texture_m: float, parts: list[Submesh]) -> Mesh:
    """Mesh of a block's parts of one material, with a texture `texture_m` wide."""
    bases = np.cumsum([0, *(len(part.positions) for part in parts)], dtype=np.uint32)
    triangles = [part.triangles + base for part, base in zip(parts, bases, strict=False)]
    coordinates_m = np.concatenate([part.texture_coordinates for part in parts])
    return Mesh(
        name,
        np.concatenate([part.positions for part in parts]),
        np.concatenate(triangles),
        material,
        texture_coordinates=(coordinates_m / np.float32(texture_m)).astype(np.float32, copy=False),
    )


def _outskirts(plots: Plots) -> dict[str, Submesh]:
    """Meadow below and around the town, and the extension of the first street across it."""
    builder = MeshBuilder()
    x0, y0, _ = plots.position_m.min(axis=0) - OUTSKIRTS_M
    x1, y1, _ = plots.position_m.max(axis=0) + OUTSKIRTS_M
    half = KERB_M - ROAD_MIDDLE_M
    for material, low, high, z in (
        ("grass", y0, y1, -3.0 * KERB_HIGH_M),
        ("asphalt", -half, half, -1.2 * KERB_HIGH_M),
    ):
        builder.quad(material, (x0, low, z), (x1, low, z), (x1, high, z), (x0, high, z))
    return builder.submeshes()


def _count(parts: dict[str, Submesh]) -> int:
    return sum(len(part.triangles) for part in parts.values())
