"""Buffers that the processor and shaders take turns with, without any scene of omnisim.

In each frame the processor writes a buffer, a compute shader makes draw commands and indices from
it, and one counted indirect draw paints a pixel per command. In every second frame the processor
reads the buffers back. That is what a driver that guesses the use of a buffer moves it by.
"""

import ctypes
import time
from typing import Any

import numpy as np

from omnisim.rendering.opengl.gl.buffers import gpu_buffer, read_buffer, written_buffer
from omnisim.rendering.opengl.gl.context import open_context
from omnisim.rendering.opengl.gl.functions import gl_function

SIDE_PX, FRAMES = 64, 12
COMMANDS, WORDS = SIDE_PX * SIDE_PX, 5  # 32-bit words of an indirect command
_TRIANGLES, _UNSIGNED_INT, _ALL_BARRIERS = 4, 0x1405, 0xFFFFFFFF
_DRAW_INDIRECT_BUFFER, _PARAMETER_BUFFER = 0x8F3F, 0x80EE
_ENUM, _INT, _SIZE = ctypes.c_uint, ctypes.c_int, ctypes.c_ssize_t
PREPARE = f"""#version 450
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Input {{ uint first_level, command_count; }};
layout(std430, binding = 1) writeonly buffer Count {{ uint count; }};
layout(std430, binding = 2) writeonly buffer Commands {{ uint command_words[]; }};
layout(std430, binding = 3) writeonly buffer Indices {{ uint indices[]; }};
void main() {{
    uint number = gl_GlobalInvocationID.x;
    if (number == 0u) count = command_count;
    uint words[{WORDS}] = uint[](3u, 1u, 3u * number, 0u, 0u);
    for (uint word = 0u; word < {WORDS}u; ++word)
        command_words[{WORDS}u * number + word] = words[word];
    for (uint corner = 0u; corner < 3u; ++corner)
        indices[3u * number + corner] = 3u * number + corner;
}}
"""
# A triangle of twice a pixel's size covers the pixel's center, and no other's.
VERTEX = f"""#version 450
layout(std430, binding = 0) readonly buffer Input {{ uint first_level, command_count; }};
flat out uint level;
void main() {{
    uint corner = uint(gl_VertexID) % 3u, number = uint(gl_VertexID) / 3u;
    vec2 pixel = vec2(number % {SIDE_PX}u, number / {SIDE_PX}u);
    vec2 place = pixel + 1.4 * vec2(corner & 1u, corner >> 1u);
    level = (first_level + number) % 256u;
    gl_Position = vec4(2.0 * place / {SIDE_PX}.0 - 1.0, 0.0, 1.0);
}}
"""
FRAGMENT = """#version 450
flat in uint level;
out vec4 color;
void main() { color = vec4(float(level) / 255.0); }
"""


def take_turns() -> dict[str, Any]:
    """Draw frames; each pixel must have the level that the processor has just written."""
    context = open_context()
    prepare = context.compute_shader(PREPARE)
    program = context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
    given = written_buffer(context, 8)
    made = [gpu_buffer(context, 4 * words) for words in (1, WORDS * COMMANDS, 3 * COMMANDS)]
    count, commands, indices = made
    array = context.vertex_array(program, [], indices, index_element_size=4)
    target = context.framebuffer([context.renderbuffer((SIDE_PX, SIDE_PX))])
    bind = gl_function("glBindBuffer", _ENUM, _ENUM)
    draw = gl_function(
        "glMultiDrawElementsIndirectCountARB", _ENUM, _ENUM, _SIZE, _SIZE, _INT, _INT
    )
    seconds, wrong = [], 0
    for frame in range(FRAMES):
        start_s = time.monotonic()
        given.write(np.array([17 * frame, COMMANDS], dtype=np.uint32))
        for binding, buffer in enumerate((given, *made)):
            buffer.bind_to_storage_buffer(binding)
        prepare.run(COMMANDS // 64)
        context.memory_barrier(_ALL_BARRIERS)
        target.use()
        target.clear()
        bind(_DRAW_INDIRECT_BUFFER, commands.glo)
        bind(_PARAMETER_BUFFER, count.glo)
        gl_function("glUseProgram", _ENUM)(program.glo)
        gl_function("glBindVertexArray", _ENUM)(array.glo)
        draw(_TRIANGLES, _UNSIGNED_INT, 0, 0, COMMANDS, 4 * WORDS)
        levels = np.frombuffer(target.read(components=1), dtype=np.uint8)
        wrong += int((levels != (17 * frame + np.arange(COMMANDS)) % 256).sum())
        if frame % 2:
            words = np.frombuffer(read_buffer(commands), dtype=np.uint32)
            wrong += int((words[2::WORDS] != 3 * np.arange(COMMANDS)).sum())
            wrong += int(np.frombuffer(read_buffer(count), dtype=np.uint32)[0] != COMMANDS)
        seconds.append(time.monotonic() - start_s)
    return {"seconds": seconds, "wrong": wrong, "error": context.error}
