"""The chain of full-screen passes between the linear picture and its encoding.

It knows no degradation by name: what each does is in `shaders/degradation/<stem>.frag`, and with
which numbers is in the `Step`. Everything is float32, because a photon in ten thousand counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.shader_files import build_program

METER_BLOCK_PX = 16  # pixels to a side of what one fragment of the light meter adds up


@dataclass(frozen=True, eq=False)
class Step:
    """One degradation on the GPU.

    Attributes:
        shader: stem of the file in `shaders/degradation`.
        uniforms: values that never change, by name.
        textures: (height, width, channels) float32 that never change, by the name of their sampler.
    """

    shader: str
    uniforms: Mapping[str, Any] = field(default_factory=dict)
    textures: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)


class FullScreen:
    """A step's program, ready to be drawn into any target."""

    def __init__(self, context: moderngl.Context, step: Step):
        self._program = build_program(
            context, "common/full_screen.vert", f"degradation/{step.shader}.frag"
        )
        for name, value in step.uniforms.items():
            self._program[name] = value
        self._textures = []
        for name, values in step.textures.items():
            height, width, channels = values.shape
            data = np.ascontiguousarray(values, dtype="<f4")
            self._textures.append(context.texture((width, height), channels, data, dtype="f4"))
            self._program[name] = len(self._textures)
        self._vertex_array = context.vertex_array(self._program, [])

    def draw(
        self,
        target: moderngl.Framebuffer,
        picture: moderngl.Texture,
        values: Mapping[str, Any] | None = None,
        others: Mapping[str, moderngl.Texture] | None = None,
    ) -> None:
        """DrawItem what becomes of a picture.

        Args:
            target: is written to.
            picture: is read as `u_picture`.
            values: of uniforms of this frame; those that the shader does not have are left out.
            others: more textures to read, by the names of their samplers.
        """
        for name, value in (values or {}).items():
            if name in self._program:
                self._program[name] = value
        target.use()
        picture.use(0)
        for unit, texture in enumerate(self._textures, start=1):
            texture.use(unit)
        for unit, (name, texture) in enumerate((others or {}).items(), len(self._textures) + 1):
            self._program[name] = unit
            texture.use(unit)
        self._vertex_array.render(moderngl.TRIANGLES, vertices=3)


class _Target:
    """A float32 picture to write to and to read from."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int]):
        try:
            self.texture = context.texture(size, 4, dtype="f4")
            self.framebuffer = context.framebuffer([self.texture])
        except moderngl.Error as reason:
            raise GraphicsError(
                f"a degraded picture of {size[0]} × {size[1]} px does not fit on this GPU "
                f"({reason}): make the picture smaller"
            ) from None


class DegradationPass:
    """From sub-frames of linear light to the linear picture that a real camera would give.

    The order is: `add` each sub-frame, `mean_luminance` if somebody wants it, `finish`, and then
    `read` and `encode`.

    Args:
        context: where.
        size: width and height of the picture.
        optics: what happens to light before the shutter, in its order.
        sensor: what happens after it.
        encoding: from linear to the values of the file, or None: as an ideal camera does.

    Raises:
        GraphicsError: a shader that does not compile, or a picture that does not fit.
    """

    def __init__(
        self,
        context: moderngl.Context,
        size: tuple[int, int],
        optics: Sequence[Step],
        sensor: Sequence[Step],
        encoding: Step | None = None,
    ):
        self._context, self._size = context, size
        self._optics = [FullScreen(context, step) for step in optics]
        self._sensor = [FullScreen(context, step) for step in sensor]
        self._encoding = None if encoding is None else FullScreen(context, encoding)
        self._spare = [_Target(context, size) for _ in range(2)]
        self._sums: list[_Target] = []
        self._is_begun = False

    @property
    def encodes(self) -> bool:
        """Whether it has an encoding of its own."""
        return self._encoding is not None

    def add(self, linear: moderngl.Texture, row_weights: NDArray[np.float32] | None = None) -> None:
        """Take a sub-frame.

        Args:
            linear: RGB and validity.
            row_weights: (height,) share of each row's exposure; None: it is the whole frame.
        """
        self._context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._current = linear
        for program in self._optics:
            self._run(program)
        if row_weights is None:
            return
        if not self._sums:
            self._sums = [_Target(self._context, self._size) for _ in range(2)]
            self._weights = self._context.texture((1, self._size[1]), 1, dtype="f4")
            self._accumulate = FullScreen(self._context, Step("accumulate"))
        self._weights.write(np.ascontiguousarray(row_weights, dtype="<f4"))
        before, after = self._sums
        if not self._is_begun:
            before.framebuffer.use()
            before.framebuffer.clear()
        self._is_begun = True
        others = {"u_sum": before.texture, "u_row_weights": self._weights}
        self._accumulate.draw(after.framebuffer, self._current, others=others)
        self._sums.reverse()
        self._current = after.texture

    def mean_luminance(self) -> float:
        """Mean luminance (Rec. 709) of the valid pixels of what was added; 0 if there are none."""
        if not hasattr(self, "_meter"):
            size = tuple(-(-length // METER_BLOCK_PX) for length in self._size)
            self._meter = FullScreen(self._context, Step("meter", {"u_block_px": METER_BLOCK_PX}))
            self._meter_target = _Target(self._context, size)
        self._meter.draw(self._meter_target.framebuffer, self._current)
        data = self._meter_target.framebuffer.read(components=4, dtype="f4")
        total, count = np.frombuffer(data, dtype="<f4").reshape(-1, 4).sum(axis=0, dtype=float)[:2]
        return float(total / count) if count > 0.0 else 0.0

    def finish(self, values: Mapping[str, Any]) -> moderngl.Texture:
        """Take the picture; `values` are those of the uniforms of this frame, by name."""
        for program in self._sensor:
            self._run(program, values)
        self._is_begun = False
        return self._current

    def read(self) -> NDArray[np.float32]:
        """The finished picture (height, width, 4), linear."""
        width, height = self._size
        data = self._current.read()
        kind = {"f2": np.float16, "f4": np.float32}[self._current.dtype]
        return np.frombuffer(data, dtype=kind).reshape(height, width, 4).astype(np.float32)

    def encode(self, target: moderngl.Framebuffer) -> None:
        """DrawItem the finished picture as the values of the file, if it `encodes`."""
        if self._encoding is not None:
            self._encoding.draw(target, self._current)

    def _run(self, program: FullScreen, values: Mapping[str, Any] | None = None) -> None:
        after = self._spare[0]
        program.draw(after.framebuffer, self._current, values)
        self._current = after.texture
        self._spare.reverse()
