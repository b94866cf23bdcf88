"""pyrender: five faces, rendered and read back one by one, then remapped by OpenCV.

This is what pyrender's users do, as it has no wide-angle camera.
"""

from __future__ import annotations

import dataclasses
import os
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.face_maps import FaceMaps, averaged, linear_from_levels
from benchmarks.peers.peer import CAMERA, ImagePeer
from omnisim.core.cube import FACE_FROM_RIG
from omnisim.core.srgb import srgb8_from_linear
from omnisim.scene.model import AlphaMode, Scene
from omnisim.validation.oracles.pyrender_rasterizer import (
    FAR_M,
    NEAR_M,
    OPTICAL_FROM_PYRENDER,
    pyrender_scene,
)

if TYPE_CHECKING:
    import pyrender

FACE_PX = 360
FACES = tuple(range(5))  # all but the one that looks up
REFERENCE_FACE_PX = 4 * FACE_PX  # each texel of four samples, as pyrender always has


class PyrenderFaces(ImagePeer):
    """Five faces rendered by pyrender in its own context, and OpenCV's remap tables."""

    def __init__(self, scene: Scene, lit: bool, device: int | None = None):
        import pyrender

        self.name = "pyrender" if lit else "pyrender, flat"
        self._flags = pyrender.RenderFlags.NONE if lit else pyrender.RenderFlags.FLAT
        self._scene = pyrender_scene(_without_masks(scene), lit)
        pinhole = pyrender.PerspectiveCamera(0.5 * np.pi, NEAR_M, FAR_M, aspectRatio=1.0)
        self._camera = self._scene.add(pinhole)
        self._renderer = _offscreen(lit, device)
        self._maps = FaceMaps(CAMERA, FACE_PX, len(FACES))
        self._faces = np.empty((FACE_PX, len(FACES) * FACE_PX, 3), dtype=np.uint8)
        self.texels = len(FACES) * FACE_PX**2
        self.triangles = len(FACES) * scene.triangle_count

    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Image (height, width, 3), sRGB."""
        self._draw(world_from_rig, self._faces)
        return self._maps.remap(self._faces)

    def reference(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Image from faces four times as large, with 8 × 8 samples per pixel."""
        size = REFERENCE_FACE_PX
        self._renderer.viewport_width = self._renderer.viewport_height = size
        faces = np.empty((size, len(FACES) * size, 3), dtype=np.uint8)
        self._draw(world_from_rig, faces)
        self._renderer.viewport_width = self._renderer.viewport_height = FACE_PX
        linear = averaged(linear_from_levels(faces), len(FACES))
        return srgb8_from_linear(linear)

    def _draw(self, world_from_rig: NDArray[np.float64], faces: NDArray[np.uint8]) -> None:
        """Render the faces, side by side."""
        size = len(faces)
        world_from_face = world_from_rig.copy()
        for column, face in enumerate(FACES):
            world_from_face[:3, :3] = world_from_rig[:3, :3] @ FACE_FROM_RIG[face].T
            self._scene.set_pose(self._camera, world_from_face @ OPTICAL_FROM_PYRENDER)
            color, _ = self._renderer.render(self._scene, self._flags)
            faces[:, column * size : (column + 1) * size] = color


@cache
def _offscreen(lit: bool, device: int | None) -> pyrender.OffscreenRenderer:
    """Renderer with its own context, shared by all scenes in succession.

    It lives as long as the process: deleting it would terminate the EGL display, and with it every
    other context of this process. It frees a scene's resources when it draws the next scene.
    """
    import pyrender

    if device is not None:
        os.environ["EGL_DEVICE_ID"] = str(device)
    return pyrender.OffscreenRenderer(FACE_PX, FACE_PX)


def _without_masks(scene: Scene) -> Scene:
    """Scene with masked surfaces blended, because pyrender fills the holes of masks."""
    materials = tuple(
        dataclasses.replace(material, alpha_mode=AlphaMode.BLEND)
        if material.alpha_mode is AlphaMode.MASK
        else material
        for material in scene.materials
    )
    return dataclasses.replace(scene, materials=materials)
