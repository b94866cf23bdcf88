"""Summary of a scene: its instances, floors, start poses and memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import triangle_crosses
from omnisim.scene.labels import find_labels
from omnisim.scene.model import Material, Scene, Texture, bounds_m
from omnisim.scene.space.floor import floor_height_m, triangles_within

# Surfaces with at most this slope and with heights within a step form one floor.
MAX_FLOOR_SLOPE_DEG = 10.0
FLOOR_STEP_M = 0.05
MIN_FLOOR_SHARE = 0.05  # share of the area of all flat surfaces that face up
Vector = tuple[float, ...]


@dataclass(frozen=True)
class InstanceSummary:
    """Summary of one instance: all parts with the same name."""

    name: str
    class_name: str
    parts: int  # number of parts
    triangles: int
    # min_m, max_m: corners of its bounding box, world frame
    min_m: Vector
    max_m: Vector
    materials: tuple[str, ...]
    textures_px: tuple[tuple[int, int], ...]  # width and height of each texture


@dataclass(frozen=True)
class Floor:
    """Floor: flat, upward-facing surfaces at one height."""

    height_m: float  # mean height
    area_m2: float  # total area


@dataclass(frozen=True)
class StartSummary:
    """Start pose of the camera or of a vehicle."""

    name: str  # start name; empty: the camera's start
    position_m: Vector
    yaw_deg: float
    floor_m: float | None  # height of the floor below or next to it; None: no floor


def instance_summaries(scene: Scene) -> tuple[InstanceSummary, ...]:
    """Summaries of the instances, in the order of their IDs."""
    labels = find_labels(scene)
    classes = {kind.id: kind.name for kind in labels.classes}
    class_of = {instance.name: classes[instance.class_id] for instance in labels.instances}
    parts: dict[str, list[int]] = {}
    for number, instance in enumerate(scene.instances):
        parts.setdefault(instance.name, []).append(number)
    summaries = []
    for name, numbers in parts.items():
        own = tuple(scene.instances[number] for number in numbers)
        meshes = [scene.meshes[instance.mesh] for instance in own]
        materials = dict.fromkeys(scene.materials[mesh.material] for mesh in meshes)
        textures = dict.fromkeys(
            texture for material in materials for texture in textures_of(material)
        )
        low, high = bounds_m(scene.meshes, own)
        summaries.append(
            InstanceSummary(
                name,
                class_of[name],
                len(own),
                sum(len(mesh.triangles) for mesh in meshes),
                tuple(low.tolist()),
                tuple(high.tolist()),
                tuple(material.name for material in materials),
                tuple((texture.pixels.shape[1], texture.pixels.shape[0]) for texture in textures),
            )
        )
    return tuple(summaries)


def floors(scene: Scene) -> tuple[Floor, ...]:
    """Floors: heights with a large share of the flat, upward-facing surfaces; largest first."""
    low, high = scene.bounds_m()
    triangles = triangles_within(scene, low[:2], high[:2])
    corners = triangles.corners_m[triangles.seen_from_above]
    normals = triangle_crosses(corners)
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    up = 0.5 * np.abs(normals[:, 2])
    flat = up > np.cos(np.radians(MAX_FLOOR_SLOPE_DEG)) * areas
    heights, areas = corners[flat, :, 2].mean(axis=1), up[flat]
    order = np.argsort(heights)
    heights, areas = heights[order], areas[order]
    large_floors, first = [], 0
    while first < len(heights):
        end = int(np.searchsorted(heights, heights[first] + FLOOR_STEP_M, side="right"))
        area = float(areas[first:end].sum())
        if area > MIN_FLOOR_SHARE * areas.sum():
            height = float(heights[first:end] @ areas[first:end]) / area
            large_floors.append(Floor(round(height, 3) + 0.0, area))  # no -0.0
        first = end
    return tuple(sorted(large_floors, key=lambda floor: -floor.area_m2))


def start_summaries(scene: Scene) -> tuple[StartSummary, ...]:
    """Start poses: the camera's, then those of vehicles."""
    starts = [("", scene.start.position_m, scene.start.yaw_deg)]
    starts += [(start.name, start.position_m, start.yaw_deg) for start in scene.starts]
    return tuple(
        StartSummary(name, place_m, yaw_deg, floor_height_m(scene, place_m[:2], place_m[2]))
        for name, place_m, yaw_deg in starts
    )


def memory_bytes(scene: Scene) -> tuple[int, int]:
    """Bytes of all mesh arrays, and of all textures without mip levels.

    Textures that differ only in their placement share their pixels.
    """
    arrays: dict[int, NDArray[np.generic]] = {}
    for mesh in scene.meshes:
        deformed = [] if mesh.deformation is None else mesh.deformation.arrays
        coordinates = mesh.texture_coordinates, mesh.second_texture_coordinates
        own = mesh.positions, mesh.triangles, mesh.normals, *coordinates, mesh.colors, *deformed
        arrays |= {id(array): array for array in own if array is not None}
    pixels = {id(texture.pixels): texture.pixels.nbytes for texture in scene_textures(scene)}
    return sum(array.nbytes for array in arrays.values()), sum(pixels.values())


def scene_textures(scene: Scene) -> list[Texture]:
    """Distinct textures of all materials."""
    return [
        *dict.fromkeys(texture for material in scene.materials for texture in textures_of(material))
    ]


def textures_of(material: Material) -> list[Texture]:
    """Textures of a material: base color texture and maps."""
    return [texture for texture in (material.texture, *material.maps) if texture is not None]
