"""Shading rate: texels per second of the virtual cameras, the upper bound for the faces.

The renderer draws an empty room with a scene's lights: twelve textured triangles, with each texel
shaded once, nothing hidden, and few vertices. The room is flat-shaded and single-sided, which is
fastest to draw.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from benchmarks.pipeline_parts import RepeatedFrame
from benchmarks.probes.probe import Probe, quickest
from benchmarks.settings import at_setting
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.scene import Scene
from omnisim.scene.model import Instance, Material, Mesh, Texture

HALF_M = 3.0
_REPEATS = 4.0  # of the texture along a wall: finer than the texels, so that two levels are read
_TEXTURE_PX = 256
# Pixels of the image: half a million texels; up to eight million on a GPU.
_SIDE_PX, _MAX_SIDE_PX = 512, 2048
_MIN_SECONDS = 5e-3  # Python's calls are some tenths of a millisecond


def empty_room(scene: Scene) -> Scene:
    """Room about the scene's start, lit by the scene's lights."""
    pixels = np.random.default_rng(5).integers(0, 256, (_TEXTURE_PX, _TEXTURE_PX, 4), np.uint8)
    pixels[..., 3] = 255
    return dataclasses.replace(
        scene,
        name=f"a room with the lamps of {scene.name}",
        meshes=(_walls(),),
        materials=(Material("walls", texture=Texture(pixels)),),
        instances=(Instance("walls", 0, _at(scene.start.position_m)),),
        labels=(),
        landmarks=(),
    )


def room_probe(scene: str, room: Stage) -> Probe:
    """Probe of an empty room, with so many texels that the cost of Python's calls is negligible.

    Args:
        scene: name of the scene that provides the lights.
        room: stage with the room.
    """
    side_px = _SIDE_PX
    while True:
        camera = at_setting(OmniCamera(polygons=PAPER_POLYGONS), "fast").resized(side_px)
        frame = RepeatedFrame.at_start(room, camera)
        if quickest(frame.render_faces) >= _MIN_SECONDS or 2 * side_px > _MAX_SIDE_PX:
            break
        frame.renderer.close()
        side_px *= 2
    samples = frame.count().virtual_cameras.samples
    return Probe(room_name(scene), "texels", samples, frame.render_faces)


def room_name(scene: str) -> str:
    """Name of the probe."""
    return f"our surfaces, by the lamps of {scene}"


def _walls() -> Mesh:
    """Box about the origin, seen from inside: four corners per side, with normals."""
    corners, normals, coordinates = [], [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            # fronts inward, as the fastest of our shaders is single-sided
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))[:: int(-side)]:
                corners.append(HALF_M * np.roll((side, u, v), axis))
                normals.append(np.roll((-side, 0.0, 0.0), axis))
                coordinates.append((0.5 * _REPEATS * (1 + u), 0.5 * _REPEATS * (1 + v)))
    quads = 4 * np.arange(6)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        "walls",
        np.array(corners, dtype=np.float32),
        quads.reshape(-1, 3).astype(np.uint32),
        0,
        normals=np.array(normals, dtype=np.float32),
        texture_coordinates=np.array(coordinates, dtype=np.float32),
    )


def _at(position_m: tuple[float, float, float]) -> NDArray[np.float64]:
    world_from_room = np.eye(4)
    world_from_room[:3, 3] = position_m
    return world_from_room
