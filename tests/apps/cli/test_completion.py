"""Shell completion, as a shell asks for it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from omnisim.apps.cli import completion
from omnisim.robots.robot_file import builtin_robots
from omnisim.scene import builtin_scenes

# What a key press must not wait for.
SLOW = ("numpy", "scipy", "moderngl", "trimesh", "OpenImageIO", "yaml", "pydantic", "rich")


def _ask(*words, folder=None, slow=SLOW):
    """Completions of a line whose last word is unfinished, by a process as the shell starts it."""
    code = (
        "import sys\n"
        "sys.argv = ['omnisim']\n"
        "from omnisim.apps.cli.app import main\n"
        "try:\n    main()\n"
        "finally:\n"
        f"    slow = [name for name in {slow!r} if name in sys.modules]\n"
        "    assert not slow, slow\n"
    )
    line = {"COMP_WORDS": " ".join(("omnisim", *words)), "COMP_CWORD": str(len(words))}
    environment = {**os.environ, **line, "_OMNISIM_COMPLETE": "bash_complete"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment, cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert not done.stderr
    items = (line.split(",", 1) for line in done.stdout.splitlines() if line)
    return [value for kind, value in items if kind == "plain"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("calibr",), ["calibration"]),
        (("render", "co"), ["compass", "courtyard"]),
        (("scan", "rin"), ["rings"]),
        (("drive", "soccer", "--robot", "p"), ["p2at"]),
        (("drive", "soccer", "--path", "lap"), ["lap", "lap_clockwise"]),
        (("drive", "soccer", "--path", "./"), []),  # the shell's: a file
        (("render", "rings", "--also", "range,flow_"), ["range,flow_backward"]),
        (("render", "rings", "--preset", "w"), ["webcam"]),
        (("render", "rings", "--quality", "fa"), ["fast"]),
        (("unwarp", "a.png", "--to", "c"), ["cylinder"]),
        (("export", "run", "--to", "col"), ["colmap", "colmap-binary"]),
        (("dataset", "convert", "set", "--to", "co"), ["coco", "colmap", "colmap-binary"]),
        (("validate", "--only", "r"), ["rings", "reflections", "rays", "response"]),
        (("robot", "check", "s"), ["superscout"]),
        (("record", "rings", "--trajectory-f"), ["--trajectory-frame"]),
    ],
    ids=" ".join,
)
def test_names_are_completed(words, expected):
    assert _ask(*words) == expected


def test_a_runs_cameras_are_completed(tmp_path):
    cameras = {name: {"type": "omnicamera"} for name in ("cam0", "cam1", "front")}
    sensors = {**cameras, "cam_imu": {"type": "imu"}}
    (tmp_path / "manifest.json").write_text(json.dumps({"sensors": sensors}))
    assert _ask("video", str(tmp_path), "--camera-name", "c") == ["cam0", "cam1"]
    assert _ask("video", "none", "--camera-name", "c") == []


def test_calibration_formats_are_completed_though_their_registry_takes_a_while():
    words = ("calibration", "convert", "a.yaml", "--to", "opencv_f")
    assert _ask(*words, slow=()) == ["opencv_fisheye"]


def test_built_in_names_are_those_of_the_modules():
    assert completion.complete_scene(None, "") == builtin_scenes()
    assert completion.complete_robot(None, "") == builtin_robots()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_script_for_each_shell_is_shown_and_installed_once(omnisim, shell, monkeypatch, tmp_path):
    status, text, _ = omnisim("--show-completion", shell)
    assert status == 0
    assert "_OMNISIM_COMPLETE" in text
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", f"/bin/{shell}")
    for _ in range(2):
        assert omnisim("--install-completion")[0] == 0
    (script,) = (path for path in tmp_path.rglob("omnisim.*") if path.is_file())
    assert script.read_text().rstrip() == text.rstrip()
    start_up = tmp_path / f".{shell}rc"
    assert shell == "fish" or start_up.read_text().count(script.name) == 1


def test_a_shell_without_completion_is_named(omnisim):
    status, _, error = omnisim("--show-completion", "tcsh")
    assert (status, error) == (
        2,
        "error: completion: expected one of bash, zsh, fish, got 'tcsh'\n",
    )


def test_a_scene_of_ones_own_completes_its_paths(tmp_path):
    Path(tmp_path, "yard.toml").write_text('[[paths]]\nname = "round"\n[[paths]]\nname = "there"\n')
    assert _ask("drive", "yard.toml", "--path", "", folder=tmp_path) == ["round", "there"]
