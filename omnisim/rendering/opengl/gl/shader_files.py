"""Shader files: includes, defines, compiler messages that name file and line, and uniforms."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import moderngl
import numpy as np

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import GraphicsError
from omnisim.core.package_files import SHADERS
from omnisim.rendering.opengl.gl import debug
from omnisim.scene.model import Fog

_INCLUDE = re.compile(r"^\s*#include\s+(\S+)\s*$")
# The second number of #line should be the file, but Mesa forgets it inside expressions. The line
# number therefore encodes the file: line 12 of file 3 is line 300012.
_LINES_PER_FILE = 100_000
# Mesa and most drivers write "0:300012(3): error"; NVIDIA writes "0(300012) : error".
_LOCATION = re.compile(r"\b\d+(?::(\d+)\(\d+\)|\((\d+)\))")


def build_program(
    context: moderngl.Context,
    vertex: str,
    fragment: str,
    defines: Sequence[str] = (),
    includes: Mapping[str, str] | None = None,
) -> moderngl.Program:
    """Compile and link a vertex and a fragment shader of the shader folder.

    Args:
        vertex, fragment: paths relative to the shader folder.
        defines: names to #define in both.
        includes: file for each `#include NAME` without quotes.

    Raises:
        GraphicsError: a file is missing or does not compile; names file and line.
    """
    with _file_names() as files:
        sources = [_expand(name, files, defines, includes or {}) for name in (vertex, fragment)]
        program = context.program(vertex_shader=sources[0], fragment_shader=sources[1])
    debug.label(debug.PROGRAM, program.glo, f"{vertex}, {fragment}")
    return program


def build_compute_shader(
    context: moderngl.Context, compute: str, defines: Sequence[str] = ()
) -> moderngl.ComputeShader:
    """Compile a compute shader of the shader folder, with names to #define.

    Raises:
        GraphicsError: the file is missing or does not compile; names file and line.
    """
    with _file_names() as files:
        shader = context.compute_shader(_expand(compute, files, defines, {}))
    debug.label(debug.PROGRAM, shader.glo, compute)
    return shader


def _expand(
    name: str, files: list[str], defines: Sequence[str], includes: Mapping[str, str]
) -> str:
    """Expand the includes of a file; append each file name to `files`."""
    files.append(name)
    before_first = _LINES_PER_FILE * len(files)
    expanded = []
    for index, line in enumerate(_lines(SHADERS / name), start=1):
        if not line.startswith("#"):
            expanded.append(line)
        elif line.startswith("#version"):
            expanded.append(line)
            expanded.extend(f"#define {define}" for define in defines)
            expanded.append(f"#line {before_first + index + 1}")
        elif include := _INCLUDE.match(line):
            target = include[1]
            target = target.strip('"') if target.startswith('"') else includes[target]
            expanded.append(f"#line {_LINES_PER_FILE * (len(files) + 1) + 1}")
            expanded.append(_expand(target, files, defines, includes))
            expanded.append(f"#line {before_first + index + 1}")
        else:
            expanded.append(line)
    return "\n".join(expanded) + "\n"


@cache
def _lines(path: Path) -> tuple[str, ...]:
    """Lines of a file, cached: many programs include it."""
    try:
        return tuple(path.read_text(encoding="utf-8").splitlines())
    except OSError:
        raise GraphicsError(f"shader {path} is missing: install omnisim again") from None


@contextmanager
def _file_names() -> Iterator[list[str]]:
    """Yield a list to collect file names; rewrite compiler messages to name file and line."""
    files: list[str] = []

    def locate(match: re.Match[str]) -> str:
        number, line = divmod(int(match[1] or match[2]), _LINES_PER_FILE)
        return f"{files[number - 1]}:{line}" if 1 <= number <= len(files) else match[0]

    try:
        yield files
    except moderngl.Error as reason:
        raise GraphicsError(f"shader: {_LOCATION.sub(locate, str(reason)).strip()}") from None


def find_uniform(
    program: moderngl.Program | moderngl.ComputeShader, name: str
) -> moderngl.Uniform | None:
    """Uniform of a program; None if the compiler removed it."""
    member = program.get(name, None)
    return member if isinstance(member, moderngl.Uniform) else None


def uniform(program: moderngl.Program | moderngl.ComputeShader, name: str) -> moderngl.Uniform:
    """Uniform of a program.

    Raises:
        KeyError: no uniform of that name.
    """
    member = find_uniform(program, name)
    if member is None:
        raise KeyError(name)
    return member


def set_uniforms(
    program: moderngl.Program | moderngl.ComputeShader, values: Mapping[str, object]
) -> None:
    """Set uniforms and samplers by name, unless the compiler removed them."""
    for name, value in values.items():
        member = find_uniform(program, name)
        if isinstance(value, np.ndarray) and member is not None:
            member.write(value)
        elif member is not None:
            member.value = value


def write_fog(program: moderngl.Program, fog: Fog) -> None:
    """Set the uniforms of shaders/scene/fog.glsl, if a program has them."""
    set_uniforms(
        program, {"u_fog_color": fog.color, "u_fog_attenuation_per_m": fog.attenuation_per_m}
    )


def columns_first(matrices: Floats) -> Floats32:
    """Matrices (..., n, n) as float32 in OpenGL's column-major order."""
    return np.ascontiguousarray(np.swapaxes(matrices, -1, -2), dtype=np.float32)
