"""The paper's method: five full virtual cameras and a textured mirror mesh.

The whole scene is drawn in each virtual camera. Source: Schmits & Visser 2008, section 2.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.batching import batched
from benchmarks.peers.face_target import (
    FRAMEBUFFER_SRGB,
    SRGB8_ALPHA8,
    ObjectDrawer,
    face_target,
    peer_program,
    srgb_texture,
)
from benchmarks.peers.peer import CAMERA, ImagePeer
from omnisim.cameras.mirrors import tessellate
from omnisim.cameras.mirrors.mirror_mesh import unfold
from omnisim.core.cube import CELL_TANGENT, FACE_FROM_RIG, LAYOUT_CELLS, LAYOUT_COLUMNS, LAYOUT_ROWS
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS
from omnisim.scene.model import Scene

FACE_PX = 360
FACES = tuple(range(5))  # all but the one that looks up


class PaperWay(ImagePeer):
    """Renderer with five framebuffers, without culling or sorting, and a mesh of 1024 polygons."""

    name = "the paper's way"

    def __init__(self, context: moderngl.Context, scene: Scene):
        self._context = context
        self._drawing = ObjectDrawer(context, batched(scene))
        self._textures = [srgb_texture(context, (FACE_PX, FACE_PX)) for _ in FACES]
        self._targets = [face_target(context, texture) for texture in self._textures]
        self.texels = len(FACES) * FACE_PX**2
        self.triangles = len(FACES) * int(self._drawing.counts.sum())
        camera = CAMERA
        self._size = (camera.width_px, camera.height_px)
        self._image = context.framebuffer(
            [context.texture(self._size, 4, internal_format=SRGB8_ALPHA8)]
        )
        self._pixels = np.empty((camera.height_px, camera.width_px, 4), dtype=np.uint8)
        self._program = peer_program(context, "mirror.vert", "mirror.frag")
        self._program["u_image_size_px"] = self._size
        self._program["u_focal_length_px"] = camera.focal_length_px
        self._program["u_principal_point_px"] = camera.principal_point_px
        self._program["u_face"] = 0
        self._parts = self._mirror_parts()

    def _mirror_parts(self) -> list[moderngl.VertexArray]:
        """Mirror mesh, cut along the edges of the cube: one vertex array per face."""
        mirror = CAMERA.mirror
        mesh = unfold(mirror, tessellate(mirror, PAPER_POLYGONS))
        cells = mesh.texture_coordinates * (LAYOUT_COLUMNS, LAYOUT_ROWS)
        # a triangle belongs to the cell of its middle: at seams, vertices lie on a cell's edge
        middles = np.floor(cells[mesh.triangles].mean(axis=1)).astype(int)
        positions = mesh.vertices_m / mirror.c_m
        parts = []
        for face in FACES:
            inside = (cells - LAYOUT_CELLS[face] - 0.5) * CELL_TANGENT + 0.5
            vertices = np.concatenate((positions, inside), axis=1).astype("<f4")
            triangles = mesh.triangles[np.all(middles == LAYOUT_CELLS[face], axis=1)]
            parts.append(
                self._context.vertex_array(
                    self._program,
                    [
                        (
                            self._context.buffer(vertices),
                            "3f4 2f4",
                            "in_position",
                            "in_texture_coordinate",
                        )
                    ],
                    self._context.buffer(triangles.astype("<u4")),
                    index_element_size=4,
                )
            )
        return parts

    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Draw five faces and the mirror, and read the image (height, width, 4)."""
        with self._context:
            return self._render(world_from_rig)

    def _render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        context, drawing = self._context, self._drawing
        drawing.set_viewpoint(world_from_rig[:3, 3])
        order = np.concatenate((drawing.opaque, drawing.back_to_front(drawing.blended)))
        for face, target in zip(FACES, self._targets, strict=True):
            drawing.draw_face(target, FACE_FROM_RIG[face] @ world_from_rig[:3, :3].T, order)
        self._image.use()
        self._image.clear()
        context.enable_direct(FRAMEBUFFER_SRGB)
        for texture, part in zip(self._textures, self._parts, strict=True):
            texture.use(0)
            part.render(moderngl.TRIANGLES)
        context.disable_direct(FRAMEBUFFER_SRGB)
        self._image.read_into(self._pixels, components=4)
        return self._pixels.copy()
