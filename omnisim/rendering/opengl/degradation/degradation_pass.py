"""Chain of full-screen passes between the linear image and its encoding.

It knows no degradation by name: the code of each is `shaders/degradation/<stem>.frag`, its numbers
are in a `EffectStep`. All images are float32, because noise depends on one photon in ten thousand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import moderngl
import numpy as np

from omnisim.core.arrays import Floats32
from omnisim.rendering.camera.degradations.image_geometry import EffectStep, Metering, UniformValue
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer, use_target
from omnisim.rendering.opengl.gl.functions import flush
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.pixel_readback import Read
from omnisim.rendering.opengl.gl.shader_files import build_program

# Readback of a light meter, and the function that reduces what was read to the metered luminance
# (Rec. 709); 0: no valid pixel.
Metered = tuple[Read, Callable[[], float]]

METER_BLOCK_PX = 16  # side of the block that one fragment of the light meter sums, pixels


class DegradationPass:
    """Degrades linear sub-frames to the linear image of a real camera.

    Call order: `add` per sub-frame, `draw_meter` for auto-exposure, `finish`, then `encode`.

    Args:
        optics: steps before the shutter, in the order of the light.
        sensor: steps after the shutter.
        encoding: step from linear values to those of the file.

    Raises:
        GraphicsError: a shader that does not compile, or an image that does not fit.
    """

    def __init__(
        self,
        context: moderngl.Context,
        size: tuple[int, int],
        optics: Sequence[EffectStep],
        sensor: Sequence[EffectStep],
        encoding: EffectStep | None = None,
    ):
        self._context, self._size = context, size
        self._optics = [_FullScreenPass(context, step) for step in optics]
        self._sensor = [_FullScreenPass(context, step) for step in sensor]
        self._encoding = _FullScreenPass(context, encoding or EffectStep("srgb"))
        self._spare = [_Target(context, size) for _ in range(2)]
        self._current = self._spare[0].texture
        self._is_first = True

    def add(self, linear: moderngl.Texture, row_weights: Floats32 | None = None) -> None:
        """Add a sub-frame, with each row's share (height,) of the exposure; None: the whole."""
        self._current = linear
        for step in self._optics:
            self._run(step)
        if row_weights is not None:
            self._current = self._shutter.add(self._current, row_weights, self._is_first)
            self._is_first = False

    def draw_meter(self, metering: Metering) -> Metered:
        """Meter the luminance (Rec. 709) of all sub-frames: sums of blocks, or one per pixel."""
        is_mean = metering.percentile is None
        meter, target = self._mean_meter if is_mean else self._pixel_meter
        meter.draw(target.framebuffer, self._current)
        width, height = target.texture.size
        values = np.empty((height, width, 4) if is_mean else (height, width), dtype=np.float32)

        def luminance() -> float:
            if not is_mean:
                return metering.of_luminances(values[values >= 0.0])  # negative: invalid
            total, count = values.reshape(-1, 4).sum(axis=0, dtype=float)[:2]
            return float(total / count) if count > 0.0 else 0.0

        return (target.texture, values), luminance

    def finish(self, uniforms: Mapping[str, UniformValue]) -> None:
        """Run the steps after the shutter; `uniforms` are this frame's values by name."""
        for step in self._sensor:
            self._run(step, uniforms)
        self._is_first = True

    @property
    def finished(self) -> moderngl.Texture:
        """The finished linear image, RGB and validity."""
        return self._current

    def encode(self, target: moderngl.Framebuffer) -> None:
        """Draw the finished image, encoded as in the file."""
        self._encoding.draw(target, self._current)

    @cached_property
    def _shutter(self) -> _Shutter:
        return _Shutter(self._context, self._size)

    @cached_property
    def _mean_meter(self) -> tuple[_FullScreenPass, _Target]:
        width, height = (-(-side // METER_BLOCK_PX) for side in self._size)
        step = EffectStep("meter", {"u_block_px": METER_BLOCK_PX})
        return _FullScreenPass(self._context, step), _Target(self._context, (width, height))

    @cached_property
    def _pixel_meter(self) -> tuple[_FullScreenPass, _Target]:
        luminances = _Target(self._context, self._size, components=1)
        return _FullScreenPass(self._context, EffectStep("luminance")), luminances

    def _run(
        self, step: _FullScreenPass, uniforms: Mapping[str, UniformValue] | None = None
    ) -> None:
        after = self._spare[0]
        step.draw(after.framebuffer, self._current, uniforms)
        self._current = after.texture
        self._spare.reverse()


class _Target:
    """Float32 render target that can be sampled."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], components: int = 4):
        self.texture = texture_2d(context, size, components)
        self.framebuffer = framebuffer(context, [self.texture])


class _FullScreenPass:
    """Program of a step that draws to any target."""

    def __init__(self, context: moderngl.Context, step: EffectStep):
        self._program = build_program(
            context, "common/full_screen.vert", f"degradation/{step.shader}.frag"
        )
        for name, value in step.uniforms.items():
            self._program[name] = value
        self._textures = []
        for unit, (name, values) in enumerate(step.textures.items(), start=1):
            (height, width, channels), data = values.shape, np.ascontiguousarray(values, "<f4")
            self._textures.append(texture_2d(context, (width, height), channels, data))
            self._program[name] = unit
        self._vertex_array = context.vertex_array(self._program, [])

    def draw(
        self,
        target: moderngl.Framebuffer,
        image: moderngl.Texture,
        uniforms: Mapping[str, UniformValue] | None = None,
        textures: Mapping[str, moderngl.Texture] | None = None,
    ) -> None:
        """Draw an image, with this frame's uniforms as far as the shader has them, and textures."""
        for name, value in (uniforms or {}).items():
            if name in self._program:
                self._program[name] = value
        use_target(target)
        image.use(0)
        for unit, texture in enumerate(self._textures, start=1):
            texture.use(unit)
        for unit, (name, texture) in enumerate((textures or {}).items(), 1 + len(self._textures)):
            self._program[name] = unit
            texture.use(unit)
        self._vertex_array.render(moderngl.TRIANGLES, vertices=3)


class _Shutter:
    """Sum of sub-frames, row by row."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int]):
        self._sums = [_Target(context, size) for _ in range(2)]
        self._row_weights = texture_2d(context, (1, size[1]), 1)
        self._accumulate = _FullScreenPass(context, EffectStep("accumulate"))

    def add(
        self, image: moderngl.Texture, row_weights: Floats32, is_first: bool
    ) -> moderngl.Texture:
        """Add a sub-frame to the frame's sum (the first one starts it); return the sum."""
        flush()  # virgl uploads before pending draws, unless they are submitted
        self._row_weights.write(np.ascontiguousarray(row_weights, dtype="<f4"))
        before, after = self._sums
        if is_first:
            clear_target(before.framebuffer)
        textures = {"u_sum": before.texture, "u_row_weights": self._row_weights}
        self._accumulate.draw(after.framebuffer, image, textures=textures)
        self._sums.reverse()
        return after.texture
