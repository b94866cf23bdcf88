"""All shaders by Khronos's reference compiler, and images by a second OpenGL driver."""

import os
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from omnisim.core.package_files import SHADERS
from tests.drivers.bounds import compare, difference
from tests.drivers.processes import (
    LLVMPIPE,
    LLVMPIPE_LIKE_VIRGL,
    VIRGL_SERVER,
    draw_by,
    draw_by_virgl,
)

COMPILER = "glslangValidator"
STAGES = (".vert", ".frag", ".comp")
# Of each kind one: these are drawn by virgl, too, to which each call is a message.
BY_VIRGL = (
    "courtyard", "mapping", "soccer by its lamps", "sphere in courtyard", "folded in courtyard",
    "tilted-mirror in courtyard", "sheets", "mirrors", "materials", "bad day", "skin",
    "lidar", "laser",
)  # fmt: skip
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("needs_opengl")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("drivers")


@pytest.fixture(scope="module")
def drawn(folder):
    """Images of all cases by llvmpipe, and of some by two drivers alike; and all shaders."""
    some = ("--sample", "--poses", "2", "--cases", *BY_VIRGL)
    with ThreadPoolExecutor(2) as pool:
        jobs = [
            pool.submit(
                draw_by, LLVMPIPE, folder / "all", "--sample", "--poses", "2",
                "--shaders", str(folder / "shaders"),
            ),
            pool.submit(draw_by, LLVMPIPE_LIKE_VIRGL, folder / "llvmpipe", *some),
        ]  # fmt: skip
        if shutil.which(VIRGL_SERVER):
            jobs.append(pool.submit(draw_by_virgl, folder / "virgl", *some))
        for job in jobs:
            job.result()
    return folder


@pytest.fixture(scope="module")
def shaders(drawn):
    return {path: path.read_text("utf-8") for path in sorted((drawn / "shaders").iterdir())}


def _need(program):
    if shutil.which(program) is None:
        assert not os.environ.get("CI"), f"CI must have {program}"
        pytest.skip(f"{program} is missing")


def test_every_image_is_drawn_the_same_again_and_in_a_batch(drawn):
    for path in (drawn / "all").glob("*.npz"):
        assert difference(path, path).unlike_itself == 0, path.stem


def test_every_shader_is_compiled(shaders):
    """Each file, in the variants of all that it asks for: by the subject that it opens with."""
    sources = list(shaders.values())
    files = [path for path in SHADERS.rglob("*") if path.suffix in (".glsl", *STAGES)]
    texts = {str(path.relative_to(SHADERS)): path.read_text("utf-8") for path in files}
    opening = {name: text.splitlines()[0] for name, text in texts.items()}
    assert len(set(opening.values())) == len(opening)
    assert not [
        name for name, line in opening.items() if not any(line in source for source in sources)
    ]
    asked = re.compile(r"#ifn?def (\w+)|defined\((\w+)\)")
    names = {a or b for text in texts.values() for a, b in asked.findall(text)}
    defined = set(re.findall(r"#define (\w+)", "\n".join(sources)))
    # images in parts are larger than any case; tests/rendering/test_images_in_parts.py draws them
    assert names - {"PARTS"} <= defined


def test_the_reference_compiler_takes_every_shader(shaders):
    _need(COMPILER)
    command = [COMPILER, *(path.name for path in shaders)]
    done = subprocess.run(
        command, cwd=next(iter(shaders)).parent, capture_output=True, text=True, check=False
    )
    complaints = [line for line in done.stdout.splitlines() if Path(line).suffix not in STAGES]
    assert done.returncode == 0, "\n".join(complaints)
    assert not any(complaints)


def test_virgl_draws_the_same(drawn, folder):
    _need(VIRGL_SERVER)
    lines = []
    assert compare(drawn / "llvmpipe", drawn / "virgl", lines.append), "\n".join(lines)
    assert len(lines) == len(BY_VIRGL)
