"""Probe: one operation, repeated until its time is measurable."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

# Long enough that a wait of some 10 µs for the GPU is negligible.
MIN_SECONDS = 3e-3
MIN_FILL_SECONDS = 5e-4  # of one draw: several make a probe, and a call costs some 2 µs
MAX_REPEATS = 4096
MIN_SIDE_PX, MAX_SIDE_PX = 512, 4096
_TRIES = 3  # the quickest counts: the first compiles


@dataclass(frozen=True, eq=False)
class Probe:
    """Repeated operation.

    Attributes:
        name: name in the report.
        unit: px, triangles, bytes or calls.
        amount: number of units per run.
        work: function that runs the operations and waits for the GPU.
    """

    name: str
    unit: str
    amount: float
    work: Callable[[], None]

    def rates(self, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Units per second, given the seconds of each run."""
        return self.amount / seconds


def repeated(
    context: moderngl.Context,
    name: str,
    unit: str,
    amount: float,
    once: Callable[[int], object],
) -> Probe:
    """Probe that repeats an operation until its time is measurable.

    Args:
        context: OpenGL context.
        name, unit: name and unit of the probe.
        amount: number of units per operation.
        once: runs the operation; its argument is the index of the repetition.
    """

    def work_of(times: int) -> Callable[[], None]:
        def work() -> None:
            with context:
                for number in range(times):
                    once(number)
                context.finish()

        return work

    times = 1
    while times < MAX_REPEATS and quickest(work_of(times)) < MIN_SECONDS:
        times *= 2
    return Probe(name, unit, times * amount, work_of(times))


def side_px(context: moderngl.Context) -> int:
    """Side of a square that takes measurable time to fill, up to a maximum size."""
    side = MIN_SIDE_PX
    with context:
        while side < MAX_SIDE_PX:
            target = context.framebuffer([context.renderbuffer((side, side), 4)])
            program = context.program(vertex_shader=FULL_SCREEN, fragment_shader=CONSTANT)
            vertex_array = context.vertex_array(program, [])
            target.use()

            def fill(drawn: moderngl.VertexArray = vertex_array) -> None:
                drawn.render(moderngl.TRIANGLES, vertices=3)
                context.finish()

            if quickest(fill) >= MIN_FILL_SECONDS:
                break
            side *= 2
    return side


def quickest(work: Callable[[], None]) -> float:
    """Approximate seconds of a run, from too few tries for a comparison."""
    seconds = []
    for _ in range(_TRIES):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


FULL_SCREEN = """
#version 430 core
void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(corner * 2.0 - 1.0, 0.5, 1.0);
}
"""
CONSTANT = """
#version 430 core
layout(location = 0) out vec4 out_color;
void main() { out_color = vec4(0.2, 0.4, 0.6, 1.0); }
"""
