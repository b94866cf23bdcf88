"""Gazebo's method: six culled faces of 512 px, copied into a cube map, warped, read back as RGB.

Source: gz-rendering, Ogre2WideAngleCamera.
"""

from __future__ import annotations

import ctypes

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.face_target import (
    FRAMEBUFFER_SRGB,
    SRGB8_ALPHA8,
    ObjectDrawer,
    face_target,
    peer_program,
    srgb_texture,
)
from benchmarks.peers.peer import CAMERA, ImagePeer
from omnisim.rendering.opengl.gl.functions import gl_function
from omnisim.rendering.opengl.gl.shader_files import columns_first, uniform
from omnisim.scene.model import Scene

FACE_PX = 512
_TEXTURE_2D, _CUBE_MAP, _CUBE_MAP_SEAMLESS = 0x0DE1, 0x8513, 0x884F
# OpenGL's cube maps are left-handed: rows are right, up and forward in the rig frame.
CUBE_FROM_RIG: NDArray[np.float64] = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
# Right, down and forward axes of each face in the cube map's frame: OpenGL 4.5, table 8.19.
FACE_FROM_CUBE: NDArray[np.float64] = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ],
    dtype=np.float64,
)
# Inward normals of the four planes that bound a face, in its own frame.
_SIDES: NDArray[np.float64] = np.array([[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]], dtype=float)


class GazeboWay(ImagePeer):
    """Renderer with one face texture and one cube map."""

    name = "Gazebo's way"

    def __init__(self, context: moderngl.Context, scene: Scene):
        self._context = context
        self._drawing = ObjectDrawer(context, scene)
        self._boxes_m = _boxes_m(self._drawing)
        self.texels = 6 * FACE_PX**2
        drawn = srgb_texture(context, (FACE_PX, FACE_PX))
        self._drawn = drawn
        self._target = face_target(context, drawn)
        self._cube = context.texture_cube((FACE_PX, FACE_PX), 4, internal_format=SRGB8_ALPHA8)
        self._cube.filter = (moderngl.LINEAR, moderngl.LINEAR)
        camera = CAMERA
        size = (camera.width_px, camera.height_px)
        self._image = context.framebuffer([context.texture(size, 4, internal_format=SRGB8_ALPHA8)])
        self._pixels = np.empty((camera.height_px, camera.width_px, 3), dtype=np.uint8)
        program = peer_program(context, "whole_target.vert", "warp.frag")
        for name, value in camera.uniforms().items():
            program[name] = value
        program["u_cube"] = 0
        cube_from_optical = CUBE_FROM_RIG @ camera.rig_from_optical
        uniform(program, "u_cube_from_optical").write(columns_first(cube_from_optical))
        self._warp = context.vertex_array(program, [])
        self._copy = gl_function("glCopyImageSubData", *[ctypes.c_uint] * 2, *[ctypes.c_int] * 13)

    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Draw and copy six faces, warp them, and read the image (height, width, 3)."""
        with self._context:
            return self._render(world_from_rig)

    def _render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        context, drawing = self._context, self._drawing
        drawing.set_viewpoint(world_from_rig[:3, 3])
        opaque = drawing.front_to_back(drawing.opaque)
        order = np.concatenate((opaque, drawing.back_to_front(drawing.blended)))
        middles, halves = self._boxes_m
        middles = middles - world_from_rig[:3, 3]
        self.triangles = 0
        for layer, face_from_cube in enumerate(FACE_FROM_CUBE):
            face_from_world = face_from_cube @ CUBE_FROM_RIG @ world_from_rig[:3, :3].T
            sides = _SIDES @ face_from_world
            seen = np.all(middles @ sides.T + halves @ np.abs(sides).T >= 0.0, axis=1)
            visible = order[seen[order]]
            self.triangles += int(drawing.counts[visible].sum())
            drawing.draw_face(self._target, face_from_world, visible)
            self._copy(
                self._drawn.glo, _TEXTURE_2D, 0, 0, 0, 0,
                self._cube.glo, _CUBE_MAP, 0, 0, 0, layer,
                FACE_PX, FACE_PX, 1,
            )  # fmt: skip
        self._image.use()
        context.enable_direct(FRAMEBUFFER_SRGB)
        context.enable_direct(_CUBE_MAP_SEAMLESS)
        self._cube.use(0)
        self._warp.render(moderngl.TRIANGLES, vertices=3)
        context.disable_direct(FRAMEBUFFER_SRGB)
        context.disable_direct(_CUBE_MAP_SEAMLESS)
        self._image.read_into(self._pixels, components=3)
        return self._pixels.copy()


def _boxes_m(drawing: ObjectDrawer) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centers and half extents (n, 3) of the objects' axis-aligned bounding boxes, world."""
    middles, halves = [], []
    for draw in drawing.draws:
        low, high = draw.mesh.positions.min(axis=0), draw.mesh.positions.max(axis=0)
        linear = draw.object_from_mesh[:3, :3]
        middles.append(linear @ (0.5 * (low + high)) + draw.object_from_mesh[:3, 3])
        halves.append(np.abs(linear) @ (0.5 * (high - low)))
    return np.array(middles), np.array(halves)
