"""OpenGL's objects are made in one package, which alone calls OpenGL by itself, and ends passes."""

import ast
import re
from pathlib import Path

import pytest

import omnisim

PACKAGE = Path(omnisim.__file__).parent
ROOM = "rendering/opengl/gl"
MAKERS = {
    "buffer": "buffers.py",
    "external_buffer": "buffers.py",
    "texture": "gpu_textures.py",
    "texture3d": "gpu_textures.py",
    "texture_array": "gpu_textures.py",
    "texture_cube": "gpu_textures.py",
    "external_texture": "gpu_textures.py",
    "depth_texture": "gpu_textures.py",
    "depth_texture_cube": "gpu_textures.py",
    "renderbuffer": "gpu_textures.py",
    "depth_renderbuffer": "gpu_textures.py",
    "framebuffer": "framebuffers.py",
    "empty_framebuffer": "framebuffers.py",
    "simple_framebuffer": "framebuffers.py",
}
# Of a moderngl.Buffer: these map it.
MAPPING = {"read_chunks", "read_chunks_into", "write_chunks", "orphan"}
# Of a moderngl.Context: these set what `GlState` does.
STATE = {"enable_only", "enable", "disable", "depth_func", "front_face", "blend_func"}
SUSPECT = re.compile(
    rf"\.({'|'.join([*MAKERS, *MAPPING])})\(|\.({'|'.join(STATE)})\b"
    "|ctypes|gl_function|end_pass|Fences"
)
FILES = {str(path.relative_to(PACKAGE)): path for path in sorted(PACKAGE.rglob("*.py"))}


def _faults(name, tree):
    """Calls of a file that belong into another, by line."""
    is_in_room = name.startswith(ROOM)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in STATE and not is_in_room:
            owner = ast.unparse(node.value).rsplit(".", 1)[-1].lstrip("_")
            if owner in ("context", "ctx"):
                yield f"{name}:{node.lineno}: {node.attr}: see {ROOM}/state.py"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            called, owner = node.func.attr, ast.unparse(node.func.value)
            is_context = owner.rsplit(".", 1)[-1].lstrip("_") in ("context", "ctx")
            place = f"{ROOM}/{MAKERS.get(called)}"
            if is_context and called in MAKERS and name != place:
                yield f"{name}:{node.lineno}: {owner}.{called}: see {place}"
            if called in MAPPING and "rendering/opengl" in name:
                yield f"{name}:{node.lineno}: {owner}.{called} maps a buffer"
        if is_in_room or not name.startswith("rendering"):
            continue
        if isinstance(node, ast.Import) and any(one.name == "ctypes" for one in node.names):
            yield f"{name}:{node.lineno}: ctypes"
        if isinstance(node, ast.ImportFrom):
            names = {one.name for one in node.names}
            if names & {"gl_function", "end_pass", "Fences"}:
                yield f"{name}:{node.lineno}: only {ROOM} calls OpenGL, and ends passes"


def test_objects_are_made_in_one_package():
    faults = []
    for name, path in FILES.items():
        text = path.read_text(encoding="utf-8")
        if SUSPECT.search(text):  # quicker than to parse all
            faults += _faults(name, ast.parse(text))
    assert not faults, "\n".join(faults)


def test_nothing_else_reads_from_the_gpu():
    """Moderngl's reads wait for the GPU, and map buffers that drivers then move."""
    reads = re.compile(r"\bread_into\(|(?<!stream)(?<!file)\.read\(\)|glGetTexImage|glReadPixels")
    drawing = {name: path for name, path in FILES.items() if name.startswith("rendering")}
    found = [name for name, path in drawing.items() if reads.search(path.read_text("utf-8"))]
    assert found == [f"{ROOM}/pixel_readback.py"]


OUTSIDE = "rendering/opengl/camera_frame.py"  # any file that draws


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("rendering/opengl/surfaces/scene_drawer.py", "buffers.context.buffer(reserve=4)"),
        (f"{ROOM}/framebuffers.py", "context.texture((1, 1), 4)"),
        (OUTSIDE, "self._context.framebuffer([one])"),
        (OUTSIDE, "self._context.front_face = 'ccw'"),
        (OUTSIDE, "import ctypes"),
        (OUTSIDE, "from omnisim.rendering.opengl.gl.functions import end_pass"),
        (OUTSIDE, "from ..gl.functions import gl_function"),
        (f"{ROOM}/buffers.py", "buffer.write_chunks(data, 0, 8, 2)"),
    ],
)
def test_other_ways_are_found(name, line):
    assert SUSPECT.search(line)
    assert len(list(_faults(name, ast.parse(line)))) == 1
