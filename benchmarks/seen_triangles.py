"""Number of triangles that an image shows: the minimum that culling can leave.

Independent of the renderer: a separate program draws every triangle's ID into whole faces of the
cube.
"""

from __future__ import annotations

from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.core.cube import FACE_FROM_RIG
from omnisim.rendering.opengl.gl.shader_files import columns_first, uniform
from omnisim.scene import Scene
from omnisim.scene.model import AlphaMode

_VERTEX = """
#version 430 core
uniform mat3 u_face_from_viewpoint;
uniform float u_near_m;
in vec3 in_position;  // meters from the viewpoint, axes of the world
void main() {
    vec3 local = u_face_from_viewpoint * in_position;
    gl_Position = vec4(local.xy, u_near_m, local.z);  // y down the image, depth reversed
}
"""
_FRAGMENT = """
#version 430 core
uniform int u_first;
layout(location = 0) out vec4 out_number;
void main() {
    int number = u_first + gl_PrimitiveID + 1;  // 0: nothing
    ivec4 bytes = (ivec4(number) >> ivec4(0, 8, 16, 24)) & 255;
    out_number = vec4(bytes) / 255.0;
}
"""


class _Triangles(NamedTuple):
    """Corners (n, 3, 3), meters from the viewpoint, of double-sided and single-sided triangles."""

    double_sided: NDArray[np.float32]
    single_sided: NDArray[np.float32]


def count_seen_triangles(
    context: moderngl.Context,
    scene: Scene,
    camera: CentralCamera,
    world_from_rig: NDArray[np.float64],
    face_px: int,
    near_m: float,
) -> int:
    """Count the triangles that are nearest in at least one texel that the image samples.

    A triangle counts once per cube face on which it is seen. Holes count as filled; blended
    surfaces are ignored.

    Args:
        context: OpenGL context, which becomes the current one.
        scene: scene to draw.
        camera: camera of the image.
        world_from_rig: (4, 4) pose of the camera's rig.
        face_px: texels across the 90° of a face.
        near_m: distance of the near plane.
    """
    parts = _triangles(scene, world_from_rig[:3, 3])
    with context:
        program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        program["u_near_m"] = near_m
        size = (face_px, face_px)
        target = context.framebuffer(
            [context.renderbuffer(size, 4)], context.depth_renderbuffer(size)
        )
        draws = []
        first = 0
        for corners, flags in (
            (parts.double_sided, moderngl.DEPTH_TEST),
            (parts.single_sided, moderngl.DEPTH_TEST | moderngl.CULL_FACE),
        ):
            if len(corners):
                content = [(context.buffer(corners), "3f4", "in_position")]
                draws.append((context.vertex_array(program, content), flags, first))
            first += len(corners)
        context.depth_func, context.front_face, context.cull_face = ">", "cw", "back"
        numbers = np.empty((face_px, face_px), dtype="<u4")
        seen = 0
        for index, face_from_rig in enumerate(FACE_FROM_RIG):
            shown = _shown(camera, index, face_px)
            if not shown.any():
                continue
            face_from_viewpoint = face_from_rig @ world_from_rig[:3, :3].T
            uniform(program, "u_face_from_viewpoint").write(columns_first(face_from_viewpoint))
            target.use()
            target.clear(depth=0.0)
            for vertex_array, flags, number in draws:
                context.enable_only(flags)
                program["u_first"] = number
                vertex_array.render(moderngl.TRIANGLES)
            target.read_into(numbers, components=4)
            seen += int(np.count_nonzero(np.unique(numbers[shown])))
    return seen


def _shown(camera: CentralCamera, face: int, face_px: int) -> NDArray[np.bool_]:
    """Mask (size, size) of a face's texels that the image samples; top row first."""
    line = (2.0 * np.arange(face_px) + 1.0) / face_px - 1.0
    right, down = np.meshgrid(line, line)
    local = np.stack((right, down, np.ones_like(right)), axis=-1)
    optical = local @ FACE_FROM_RIG[face] @ camera.rig_from_optical
    pixels, valid = camera.pixel_from_ray(optical)
    inside = (pixels >= -0.5) & (pixels <= (camera.width_px - 0.5, camera.height_px - 0.5))
    return valid & inside.all(axis=-1)


def _triangles(scene: Scene, viewpoint_m: NDArray[np.float64]) -> _Triangles:
    parts: tuple[list[NDArray[np.float32]], list[NDArray[np.float32]]] = ([], [])
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        material = scene.materials[mesh.material]
        if material.alpha_mode is AlphaMode.BLEND:
            continue
        linear = instance.world_from_mesh[:3, :3]
        positions_m = mesh.positions @ linear.T + (instance.world_from_mesh[:3, 3] - viewpoint_m)
        corners = positions_m.astype(np.float32)[mesh.triangles]
        if np.linalg.det(linear) < 0.0:
            corners = corners[:, ::-1]
        parts[not material.double_sided].append(corners)
    none = [np.empty((0, 3, 3), dtype=np.float32)]
    double_sided, single_sided = (np.concatenate(none + part) for part in parts)
    return _Triangles(double_sided, single_sided)
