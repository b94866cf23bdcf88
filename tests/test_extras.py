"""Extras: a command without its packages ends in one line, and rendering needs none of them."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from omnisim.core.errors import GraphicsError, OutputError
from omnisim.core.extras import (
    DISTRIBUTION,
    EXTRAS,
    REQUIRED,
    install_hint,
    require_extra,
    require_opengl,
)

PROJECT = Path(__file__).resolve().parents[1] / "pyproject.toml"
OPTIONAL = ("matplotlib", "jinja2", "networkx", "lxml", "av", "mujoco", "pxr")


def _run(folder, *commands):
    """Commands in one process without the optional modules; each ends with its status."""
    code = (
        "import sys\nfrom omnisim.apps.cli.app import main\n"
        f"sys.modules.update(dict.fromkeys({OPTIONAL!r}))\n"
        f"for command in {commands!r}:\n"
        "    sys.argv = ['omnisim', *command.split()]\n"
        "    try:\n        main()\n"
        "    except SystemExit as stopped:\n        print('status', stopped.code or 0)\n"
    )
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip


def _package(requirement):
    """Package of a requirement, without its versions and markers."""
    return re.match(r"[\w.-]+", requirement)[0]


def test_packages_are_those_of_the_project():
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    assert project["name"] == DISTRIBUTION != "omnisim"
    assert project["scripts"].keys() == {"omnisim"}
    required = {_package(each) for each in project["dependencies"]}
    assert set(REQUIRED) == required - {"moderngl"}  # of an extra, where there is no wheel
    extras = project["optional-dependencies"]
    for extra, packages in EXTRAS.items():
        expected = {_package(each) for each in extras[extra]}
        if sys.version_info >= (3, 12):
            expected -= {"pyrender"}
        assert set(packages) == expected, extra
    (everything,) = extras["all"]
    # Needs a compiler; simulators; for tests; GPL; for clusters.
    left_out = {
        "genesis",
        "gymnasium",
        "meshopt",
        "newton",
        "oracles",
        "orb-slam3",
        "pybullet",
        "ray",
        "sapien",
    }
    (named,) = re.findall(r"\[(.*)\]", everything)
    assert everything == f"{DISTRIBUTION}[{named}]"
    assert set(named.split(",")) == EXTRAS.keys() - left_out
    lines = (PROJECT.parent / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = {line.partition("==")[0].lower() for line in lines if "==" in line}
    every = [*project["dependencies"], *(each for extra in extras.values() for each in extra)]
    assert {_package(each).lower() for each in every} - {DISTRIBUTION} <= pinned


def test_missing_packages_are_named_with_the_command_that_installs_them(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.raises(OutputError) as error:
        require_extra("reports", "omnisim validate", OutputError)
    assert str(error.value) == (
        "omnisim validate needs matplotlib and jinja2: pip install 'omnisim-camera[reports]'"
    )
    require_extra("video", "omnisim video")  # is installed


COMMANDS = [
    ("plot run", "omnisim plot", "matplotlib", "plots"),
    ("video run -o a.mp4", "omnisim video", "av", "video"),
    ("scan mapping -o a.csv --plot a.png", "--plot", "matplotlib", "plots"),
    ("landmarks detect run --model a.npz --show a.png", "--show", "matplotlib", "plots"),
    ("localize run -o a", "omnisim localize", "matplotlib and jinja2", "reports"),
    ("validate -o a", "omnisim validate", "matplotlib and jinja2", "reports"),
    ("experiments -o a", "omnisim experiments", "matplotlib and jinja2", "reports"),
    ("render box.usda -o a.png", "box.usda", "usd-core", "usd"),
    ("render box.xml -o a.png", "box.xml", "mujoco-core", "mujoco"),
]


def test_a_command_without_its_extra_ends_in_one_line(tmp_path):
    (tmp_path / "box.xml").write_text("<mujoco/>")
    (tmp_path / "box.usda").write_text("#usda 1.0")
    (tmp_path / "run").mkdir()
    done = _run(tmp_path, *(command for command, *_ in COMMANDS))
    assert done.stdout == "status 1\n" * len(COMMANDS)
    assert done.stderr.splitlines() == [
        f"error: {feature} needs {package}: {install_hint(extra)}"
        for _, feature, package, extra in COMMANDS
    ]
    assert {path.name for path in tmp_path.iterdir()} == {"box.usda", "box.xml", "run"}


@pytest.mark.parametrize(
    ("system", "words"),
    [
        ("Linux", "needs moderngl: pip install 'omnisim-camera[opengl]'; "),
        ("Darwin", "needs OpenGL through EGL, which Linux alone has; "),
    ],
)
def test_without_opengl_the_other_back_end_is_named(monkeypatch, system, words):
    monkeypatch.setitem(sys.modules, "moderngl", None)
    monkeypatch.setattr("platform.system", lambda: system)
    with pytest.raises(GraphicsError) as error:
        require_opengl("back end 'cube'")
    assert str(error.value) == f"back end 'cube' {words}back end 'rays' needs no OpenGL"


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_images_meshes_and_scans_need_no_extra(tmp_path):
    (tmp_path / "a.obj").write_text("v -2 0 2\nv 2 0 2\nv 0 3 -2\nf 1 2 3\n")
    done = _run(
        tmp_path,
        "render a.obj --size 24 -o a.png",
        "mirror -n 64 -o a.glb",
        "mirror -n 64 -o a.ply",
        "scan mapping -o a.csv",
    )
    assert done.stdout.count("status 0\n") == 4, done.stderr
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {"a.obj", "a.png", "a.glb", "a.ply", "a.csv"}


def test_benchmarks_without_their_extra_end_in_one_line(tmp_path):
    code = (
        "import sys\nsys.modules['matplotlib'] = None\n"
        "from benchmarks.__main__ import main\nsys.exit(main(['fps', '-o', 'out']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(PROJECT.parent)},
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == f"error: python -m benchmarks needs matplotlib: {install_hint('plots')}\n"
    assert not any(tmp_path.iterdir())


def test_help_needs_no_extra(tmp_path):
    names = ("plot", "video", "validate", "experiments", "localize", "scan")
    done = _run(tmp_path, *(f"{name} --help" for name in names))
    assert done.stdout.count("status 0\n") == len(names), done.stderr
    assert all(f"omnisim {name} " in done.stdout for name in names)
