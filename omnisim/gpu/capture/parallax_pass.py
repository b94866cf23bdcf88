"""Samples of rays with origins of their own, from the atlas of one viewpoint and its depth."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.capture.picture_pass import picture_array
from omnisim.gpu.capture.tile_uniforms import bind_tiles
from omnisim.gpu.memory import gpu_allocation
from omnisim.gpu.shader_files import build_program
from omnisim.gpu.uniforms import uniform

_ATLAS, _RAYS, _ORIGINS, _DEPTH = range(4)  # texture units
_TOLERANCE_TEXELS = 1.0  # a look-up that moves by less is decided

CastSamples = Callable[[NDArray[np.intp]], NDArray[np.float32]]


class ViewpointRays(NamedTuple):
    """Rays of samples as the viewpoint has them, rig frame."""

    directions: NDArray[np.float32]  # (height, width, 3), unit
    origins_m: NDArray[np.float32]  # (height, width, 3), from the viewpoint
    valid: NDArray[np.bool_]  # (height, width)


class ParallaxPass:
    """Picture pass of a camera whose rays do not meet.

    Args:
        context: of OpenGL.
        rays: of the samples.
        plan: tiles of the atlas.
        supersampling: samples to a side of a pixel.
        near_m, far_m: of the virtual cameras; far may be infinite.

    Attributes:
        undecided_samples: of the last picture.

    Raises:
        GraphicsError: no memory for it.
    """

    def __init__(
        self,
        context: moderngl.Context,
        rays: ViewpointRays,
        plan: TilePlan,
        supersampling: int,
        near_m: float,
        far_m: float,
    ):
        height, width = rays.valid.shape
        self._context, self.undecided_samples = context, 0
        with gpu_allocation(
            f"a capture of {width} × {height} px",
            "make the picture or camera.supersampling smaller",
        ):
            valid = rays.valid[..., None].astype(np.float32)
            texels = np.concatenate((rays.directions, valid), axis=-1)
            self._rays = context.texture((width, height), 4, texels.tobytes(), dtype="f4")
            texels = np.concatenate((rays.origins_m, valid), axis=-1)
            self._origins = context.texture((width, height), 4, texels.tobytes(), dtype="f4")
            self._depth = context.texture((plan.width_px, plan.height_px), 1, dtype="f4")
            self._colors = context.texture((width, height), 4, dtype="f4")
            self._undecided = context.texture((width, height), 1, dtype="f1")
        for texture in (self._rays, self._origins, self._depth, self._colors):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._target = context.framebuffer([self._colors, self._undecided])
        self._context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._add_levels(plan)
        program = self._program(plan)
        for name, unit in (("atlas", _ATLAS), ("depth", _DEPTH)):
            uniform(program, f"u_{name}").value = unit
        share = near_m / (far_m - near_m)  # 0 where far is infinite
        uniform(program, "u_depth_from_inverse_z").value = (-share, near_m * (1.0 + share))
        uniform(program, "u_near_m").value = near_m
        finest = max(tile.face_size_px for tile in plan.tiles)
        uniform(program, "u_tolerance_rad").value = _TOLERANCE_TEXELS * 2.0 / finest
        self._samples_array = context.vertex_array(program, [])
        self._samples_array.vertices = 3
        shape = height // supersampling, supersampling, width // supersampling, supersampling
        shown = np.asarray(rays.valid.reshape(shape).any(axis=(1, 3)))
        self._array = picture_array(context, shown, supersampling)

    def _program(self, plan: TilePlan, *defines: str) -> moderngl.Program:
        program = build_program(
            self._context, "common/full_screen.vert", "capture/parallax.frag", defines
        )
        bind_tiles(program, plan, np.eye(3))
        uniform(program, "u_rays").value = _RAYS
        uniform(program, "u_origins").value = _ORIGINS
        return program

    def _add_levels(self, plan: TilePlan) -> None:
        """Draw mip levels beside the origins."""
        self._rays.use(_RAYS)
        self._origins.use(_ORIGINS)
        self._target.use()
        array = self._context.vertex_array(self._program(plan, "LEVELS"), [])
        array.vertices = 3
        array.render()
        self._origins.write(self._colors.read())

    def draw(
        self,
        atlas: moderngl.Texture,
        depth: NDArray[np.float32],
        target: moderngl.Framebuffer,
        cast: CastSamples | None,
    ) -> None:
        """Draw the valid pixels: encoded, and linear where the target has a second attachment.

        Args:
            atlas: of the viewpoint.
            depth: (height, width) of its texels.
            target: of the picture.
            cast: gives linear RGB (n, 3) of undecided samples (n,), row by row; None: they keep
                what the last step found.
        """
        self._depth.write(depth)
        for unit, texture in enumerate((atlas, self._rays, self._origins, self._depth)):
            texture.use(unit)
        self._context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._target.use()
        self._samples_array.render()
        undecided = np.flatnonzero(np.frombuffer(self._undecided.read(alignment=1), np.uint8))
        self.undecided_samples = len(undecided)
        if cast is not None and len(undecided):
            colors = np.frombuffer(self._colors.read(), np.float32).reshape(-1, 4).copy()
            colors[undecided, :3] = cast(undecided)
            self._colors.write(colors)
        self._colors.use(0)
        target.use()
        self._array.render()
