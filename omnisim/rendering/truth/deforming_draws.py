"""Draw items of the OpenGL back end with deforming meshes."""

from __future__ import annotations

from omnisim.rendering.hit_source import DeformingDraw
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers


def deforming_draws(buffers: SceneBuffers) -> dict[int, DeformingDraw]:
    """Draw items with deforming meshes, by index."""
    items = {index: buffers.draw_items[index] for index in buffers.deforming.tolist()}
    return {
        index: DeformingDraw(one.mesh, one.object_index, one.object_from_mesh)
        for index, one in items.items()
    }
