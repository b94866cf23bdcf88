"""Shaders are read with their includes, and messages of compilers name lines of their files."""

import re

import pytest

import omnisim.rendering.opengl.gl.shader_files as shader_files
from omnisim.core.errors import GraphicsError
from omnisim.core.package_files import SHADERS
from omnisim.rendering.opengl.gl.shader_files import build_compute_shader, build_program

SUFFIXES = (".glsl", ".vert", ".frag", ".comp")


@pytest.mark.parametrize(
    ("body", "included", "place"),
    [
        (
            'out vec4 color;\n#include "c.glsl"\nvoid main() { color = f(); }\n',
            "// fine\nvec4 f() {\n    return nonsense;\n}\n",
            r"c\.glsl:3",
        ),
        (  # lines after an include still count in their file
            '#include "c.glsl"\nout vec4 color;\nvoid main() { color = nonsense; }\n',
            "const float x = 1.0;\nconst float y = 2.0;\n",
            r"b\.frag:4",
        ),
    ],
)
def test_messages_of_the_compiler_name_file_and_line(
    context, tmp_path, monkeypatch, body, included, place
):
    monkeypatch.setattr(shader_files, "SHADERS", tmp_path)
    (tmp_path / "a.vert").write_text("#version 430 core\nvoid main() { gl_Position = vec4(0); }\n")
    (tmp_path / "b.frag").write_text("#version 430 core\n" + body)
    (tmp_path / "c.glsl").write_text(included)
    (tmp_path / "a.comp").write_text("#version 430 core\nlayout(local_size_x = 1) in;\nnonsense;\n")
    with pytest.raises(GraphicsError, match=place):
        build_program(context, "a.vert", "b.frag", defines=("ANYTHING",))
    with pytest.raises(GraphicsError, match=r"a\.comp:3"):
        build_compute_shader(context, "a.comp", ("ANYTHING",))
    with pytest.raises(GraphicsError, match=r"none\.vert is missing"):
        build_program(context, "none.vert", "none.frag")


def test_lines_of_shaders_have_at_most_100_columns():
    files = [path for path in SHADERS.rglob("*") if path.suffix in SUFFIXES]
    assert files
    wide = [
        f"{path.name}:{number}"
        for path in files
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1)
        if len(line) > 100
    ]
    assert not wide


@pytest.mark.parametrize("folder", ["scene/surface", "scene/caster", "ground_truth/"])
def test_features_of_surfaces_and_hits_are_chosen_outside_of_main(folder):
    """The file of a feature defines its functions both with and without it."""
    mains = {
        path.name: re.search(r"^void main\(\) {\n(.*?)^}", path.read_text("utf-8"), re.S | re.M)
        for path in SHADERS.glob(f"{folder}*")
        if path.suffix in (".vert", ".frag")
    }
    assert len(mains) >= 2
    assert not [name for name, main in mains.items() if main is None or "#" in main[1]]
