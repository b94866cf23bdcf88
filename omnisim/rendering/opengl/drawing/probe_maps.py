"""Cube maps of reflection probes, with a level per roughness."""

from __future__ import annotations

import weakref
from collections.abc import Collection
from enum import Enum

import moderngl
import numpy as np

from omnisim.rendering.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.pixel_map import bind_tiles
from omnisim.rendering.opengl.gl.framebuffers import attach_layer, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import (
    bind_texture,
    cube_array,
    limit_levels,
    texture_2d,
)
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.shader_files import build_program, uniform
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS

LEVELS = 6
# Squared roughness of each level, as in shaders/scene/reflection_probe.glsl.
_ALPHAS = (0.0, *(0.024 * 2.0**level for level in range(LEVELS - 1)))
_FACES = 6
_MIN_ROUGH = 0.25  # roughness from which level 2 and further ones are looked up
_COLORS_UNIT, _DEPTHS_UNIT, _CUBES_UNIT = 0, 1, 0
# Lobes of two levels add up between linearly and by their squares.
_POWER = 1.5


class Gloss(Enum):
    """Numbers of samples of level 1, and of each further level, by the gloss of a probe's surfaces.

    Levels of perfect mirrors filter small reflections. Level 1 is looked up by smooth gloss, where
    its samples would be visible beside bright lamps.
    """

    MIRROR = (4, 4)
    SMOOTH = (48, 32)
    ROUGH = (12, 24)

    @classmethod
    def of(cls, roughness: Collection[float]) -> Gloss:
        """Gloss of surfaces of the given roughnesses."""
        rough = [one for one in roughness if one > MIN_ROUGHNESS]
        if not rough:
            return cls.MIRROR
        return cls.SMOOTH if min(rough) < _MIN_ROUGH else cls.ROUGH


class ProbeMaps:
    """Array of cube maps: light and inverse distance, then light filtered for roughness.

    Args:
        plan: atlas of six whole faces that probes are drawn into.
        near_m: near plane of the atlas's depth.
        cubes: number of probes.

    Attributes:
        name: OpenGL's name of the texture.
    """

    def __init__(self, context: moderngl.Context, plan: TilePlan, near_m: float, cubes: int):
        self._size_px, self._state = plan.tiles[0].face_size_px, GlState()
        with gpu_allocation(
            f"{cubes} reflection probes of {self._size_px} px",
            "make virtual_cameras.reflection_probes smaller",
        ):
            self.name = cube_array(context, self._size_px, LEVELS, cubes)
            attached = texture_2d(context, (1, 1), 4, dtype="f2")  # until a face is
        dropped = weakref.finalize(self, context.extra.dropped_textures.append, self.name)
        dropped.atexit = False  # the end of the process frees it
        self._target = framebuffer(context, [attached])
        self._faces = build_program(context, "common/full_screen.vert", "scene/probe_face.frag")
        bind_tiles(self._faces, plan, np.eye(3))
        uniform(self._faces, "u_colors").value = _COLORS_UNIT
        uniform(self._faces, "u_depths").value = _DEPTHS_UNIT
        uniform(self._faces, "u_near_m").value = near_m
        self._gloss = build_program(context, "common/full_screen.vert", "scene/probe_gloss.frag")
        uniform(self._gloss, "u_cubes").value = _CUBES_UNIT
        self._face_triangle = context.vertex_array(self._faces, [])
        self._gloss_triangle = context.vertex_array(self._gloss, [])

    def draw(
        self, cube: int, colors: moderngl.Texture, depths: moderngl.Texture, gloss: Gloss
    ) -> None:
        """Copy a probe from its atlas, and filter its levels.

        Args:
            cube: index of the probe.
            colors, depths: atlas.
            gloss: gloss of its surfaces.
        """
        colors.use(_COLORS_UNIT)
        depths.use(_DEPTHS_UNIT)
        self._draw_level(cube, 0, self._faces, self._face_triangle)
        bind_texture(_CUBES_UNIT, self.name)
        uniform(self._gloss, "u_cube").value = float(cube)
        for level in range(1, LEVELS):
            uniform(self._gloss, "u_facets").value = gloss.value[level > 1]
            between = (_ALPHAS[level] ** _POWER - _ALPHAS[level - 1] ** _POWER) ** (1.0 / _POWER)
            uniform(self._gloss, "u_alpha").value = between
            limit_levels(self.name, level - 1, level - 1)
            self._draw_level(cube, level, self._gloss, self._gloss_triangle)
        limit_levels(self.name, 0, LEVELS - 1)

    def _draw_level(
        self, cube: int, level: int, program: moderngl.Program, triangle: moderngl.VertexArray
    ) -> None:
        size_px = self._size_px >> level
        uniform(program, "u_texel").value = 1.0 / size_px
        for face in range(_FACES):
            attach_layer(self._target.glo, self.name, _FACES * cube + face, level=level)
            self._state.use(self._target)
            uniform(program, "u_face").value = face
            with self._state.within_rectangles(self._target) as aim:
                aim(0, 0, size_px, size_px)
                triangle.render(moderngl.TRIANGLES, vertices=3)
