"""Vertex and index buffers for shaders, in windows if they exceed the size of a binding.

The bindings are those of shaders/scene/vertex_words.glsl.
"""

from __future__ import annotations

import moderngl

MAX_WINDOWS = 3
_FIRST_BINDINGS = (0, 1)
_MORE_BINDINGS = (8, 10)


def window_bytes(context: moderngl.Context) -> int:
    """Size of a window: the largest power of two that a shader may read."""
    limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
    return 1 << (limit.bit_length() - 1)


def window_defines(context: moderngl.Context, *buffers: moderngl.Buffer) -> tuple[str, ...]:
    """Defines of shaders that read buffers; empty if each fits into one binding."""
    size = window_bytes(context)
    if all(one.size <= size for one in buffers):
        return ()
    return (f"WINDOW_WORD_BITS {size.bit_length() - 3}",)


def bind_triangles(
    context: moderngl.Context, vertices: moderngl.Buffer, indices: moderngl.Buffer
) -> None:
    """Bind vertices and indices, in at most `MAX_WINDOWS` windows each."""
    size = window_bytes(context)
    for buffer, first, more in zip(
        (vertices, indices), _FIRST_BINDINGS, _MORE_BINDINGS, strict=True
    ):
        if buffer.size <= size:
            buffer.bind_to_storage_buffer(first)
            continue
        for number in range(MAX_WINDOWS):
            # windows past the end are never read, but must be bound, because shaders declare them
            start = number * size if number * size < buffer.size else 0
            binding = more + number - 1 if number else first
            buffer.bind_to_storage_buffer(binding, start, min(size, buffer.size - start))
