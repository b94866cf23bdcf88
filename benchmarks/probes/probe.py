"""One thing done often enough that a clock can tell how fast the machine does it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

# So long that a call of some 10 µs to wait for the GPU is no part of it worth speaking of.
LEAST_SECONDS = 3e-3
LEAST_FILL_SECONDS = 5e-4  # of one draw: several make a probe, and a call costs some 2 µs
MOST_REPEATS = 4096
SMALLEST_SIDE_PX, LARGEST_SIDE_PX = 512, 4096
_ASKED = 3  # times; the quickest counts: the first compiles


@dataclass(frozen=True, eq=False)
class Probe:
    """What the machine is asked for.

    Attributes:
        name: of it.
        unit: of what is counted: px, triangles, bytes, calls.
        amount: how many of them each time.
        work: does it and waits until it is done.
    """

    name: str
    unit: str
    amount: float
    work: Callable[[], None]

    def rates(self, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        """How many a second, for each time that it took."""
        return self.amount / seconds


def repeated(
    context: moderngl.Context,
    name: str,
    unit: str,
    amount: float,
    once: Callable[[int], object],
) -> Probe:
    """A probe that does something as often as a clock needs.

    Args:
        context: where.
        name, unit: of the probe.
        amount: in one time.
        once: does it; its argument counts the times.
    """

    def work_of(times: int) -> Callable[[], None]:
        def work() -> None:
            with context:
                for number in range(times):
                    once(number)
                context.finish()

        return work

    times = 1
    while times < MOST_REPEATS and quickest(work_of(times)) < LEAST_SECONDS:
        times *= 2
    return Probe(name, unit, times * amount, work_of(times))


def side_px(context: moderngl.Context) -> int:
    """Side of a square that takes long enough to fill, if any does."""
    side = SMALLEST_SIDE_PX
    with context:
        while side < LARGEST_SIDE_PX:
            target = context.framebuffer([context.renderbuffer((side, side), 4)])
            program = context.program(vertex_shader=FULL_SCREEN, fragment_shader=CONSTANT)
            vertex_array = context.vertex_array(program, [])
            target.use()

            def fill(drawn: moderngl.VertexArray = vertex_array) -> None:
                drawn.render(moderngl.TRIANGLES, vertices=3)
                context.finish()

            if quickest(fill) >= LEAST_FILL_SECONDS:
                break
            side *= 2
    return side


def quickest(work: Callable[[], None]) -> float:
    """Seconds that something takes, which nobody shall compare with anything."""
    seconds = []
    for _ in range(_ASKED):
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
