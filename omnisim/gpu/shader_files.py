"""Shader files: includes, variants, and compiler messages that point at the file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import moderngl

from omnisim.errors import GraphicsError
from omnisim.resources import SHADERS

_INCLUDE = re.compile(r"^\s*#include\s+(\S+)\s*$")
# llvmpipe and most drivers write "0:12(3): error"; NVIDIA writes "0(12) : error".
_PLACE = re.compile(r"\b(\d+)(?::(\d+)\(\d+\)|\((\d+)\))")


def build_program(
    context: moderngl.Context,
    vertex: str,
    fragment: str,
    defines: Sequence[str] = (),
    includes: Mapping[str, str] | None = None,
) -> moderngl.Program:
    """Compile and link two files of the shader folder.

    Args:
        context: where.
        vertex, fragment: files, relative to the folder.
        defines: names to #define in both.
        includes: what `#include NAME`, without quotes, stands for.

    Raises:
        GraphicsError: a file is missing or does not compile; names file and line.
    """
    files: list[str] = []
    sources = [_expand(name, files, defines, includes or {}) for name in (vertex, fragment)]
    try:
        return context.program(vertex_shader=sources[0], fragment_shader=sources[1])
    except moderngl.Error as reason:
        raise GraphicsError(_with_file_names(str(reason), files)) from None


def _expand(
    name: str, files: list[str], defines: Sequence[str], includes: Mapping[str, str]
) -> str:
    """The text of a file with its includes in place; `files` collects names by #line number."""
    number = len(files)
    files.append(name)
    try:
        lines = (SHADERS / name).read_text(encoding="utf-8").splitlines()
    except OSError:
        raise GraphicsError(f"shader {SHADERS / name} is missing: install omnisim again") from None
    expanded = []
    for index, line in enumerate(lines, start=1):
        if line.startswith("#version"):
            expanded.append(line)
            expanded.extend(f"#define {define}" for define in defines)
            expanded.append(f"#line {index + 1} {number}")
        elif include := _INCLUDE.match(line):
            target = include[1]
            target = target.strip('"') if target.startswith('"') else includes[target]
            expanded.append(f"#line 1 {len(files)}")
            expanded.append(_expand(target, files, defines, includes))
            expanded.append(f"#line {index + 1} {number}")
        else:
            expanded.append(line)
    return "\n".join(expanded) + "\n"


def _with_file_names(message: str, files: Sequence[str]) -> str:
    def place(match: re.Match[str]) -> str:
        number = int(match[1])
        if number >= len(files):
            return match[0]
        return f"{files[number]}:{match[2] or match[3]}"

    return "shader: " + _PLACE.sub(place, message).strip()
