"""Bad input of every kind: one line each, status 1, and no file.

`messages.toml` has the commands, and all that they print. A fault that is mended changes its line
there; a new one gets a line.
"""

import os
import re
import shlex
import tomllib
from pathlib import Path

import pytest

from tests.apps.cli.image_files import write_images

TABLE = tomllib.loads(Path(__file__).with_name("messages.toml").read_text(encoding="utf-8"))
OPENGL = "OpenGL"
LIBRARIES = re.compile(
    r"pydantic|typer|\bclick\b|numpy|traceback|\bpxr\b|embree|moderngl|trimesh|openimageio|scipy"
    r"|errno|nonetype|dtype|<class|input should|could not convert|has no attribute",
    re.IGNORECASE,
)


@pytest.fixture
def inputs(tmp_path):
    """Files of the table, and images; the names of all."""
    write_images(tmp_path)
    for name, text in TABLE["files"].items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return sorted(path.name for path in tmp_path.iterdir())


@pytest.mark.parametrize("kind", TABLE["messages"])
def test_bad_input_is_one_line_and_no_file(omnisim, inputs, tmp_path, request, kind):
    if kind == OPENGL:
        request.getfixturevalue("needs_opengl")
    for command, expected in TABLE["messages"][kind].items():
        status, out, error = omnisim(*shlex.split(command))
        lines = "".join(f"error: {line}\n" for line in expected.split("\n"))
        assert (command, status, out, error) == (command, 1, "", lines)
        assert not LIBRARIES.search(error), command
    assert sorted(path.name for path in tmp_path.iterdir()) == inputs


def test_outputs_need_not_be_readable(quiet, needs_opengl, tmp_path, monkeypatch):
    """Nobody asks for permission to read; as root, `os.access` gives it always."""
    readable = os.access
    monkeypatch.setattr(
        os, "access", lambda path, mode, **more: mode != os.R_OK and readable(path, mode, **more)
    )
    outputs = [tmp_path / name for name in ("o.png", "o.exr", "o.json")]
    for path in outputs:
        path.touch()
    (tmp_path / "a.obj").write_text(TABLE["files"]["a.obj"])
    others = ("--rays", "o.exr", "--calibration", "o.json")
    quiet("render", "a.obj", "-o", "o.png", "--size", 16, *others)
    assert all(path.stat().st_size for path in outputs)
