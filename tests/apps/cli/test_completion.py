"""Shell completion, as a shell asks for it."""

import json
import os
import subprocess
import sys

import pytest

from omnisim.apps.cli import completion
from omnisim.robots.robot_file import builtin_robots
from omnisim.scene import builtin_scenes

# What a key press must not wait for.
SLOW = (
    "numpy", "scipy", "moderngl", "trimesh", "OpenImageIO", "PIL", "matplotlib", "yaml", "pydantic",
    "rich",
)  # fmt: skip
PROGRAM = """
import json, os, sys
sys.argv = ['omnisim']
from omnisim.apps.cli.app import main
for words in json.loads(os.environ['LINES']):
    os.environ['COMP_WORDS'], os.environ['COMP_CWORD'] = ' '.join(words), str(len(words) - 1)
    print('line')
    try:
        main()
    except SystemExit:
        pass
slow = [name for name in os.environ['SLOW'].split() if name in sys.modules]
assert not slow, slow
"""


def _ask(*lines, folder=None, slow=SLOW):
    """Completions of lines whose last words are unfinished, by a process as the shell starts it."""
    asked = json.dumps([["omnisim", *line] for line in lines])
    shell = {"_OMNISIM_COMPLETE": "bash_complete", "LINES": asked, "SLOW": " ".join(slow)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=os.environ | shell, cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert not done.stderr
    answers = (answer.splitlines() for answer in done.stdout.split("line\n")[1:])
    return [[item[6:] for item in items if item.startswith("plain,")] for items in answers]


COMPLETED = {
    ("calibr",): ["calibration"],
    ("render", "co"): ["compass", "courtyard"],
    ("scan", "rin"): ["rings"],
    ("drive", "soccer", "--robot", "p"): ["p2at"],
    ("drive", "soccer", "--path", "lap"): ["lap", "lap_clockwise"],
    ("drive", "soccer", "--path", "./"): [],  # the shell's: a file
    ("render", "rings", "--also", "range,flow_"): ["range,flow_backward"],
    ("render", "rings", "--preset", "w"): ["webcam"],
    ("render", "rings", "--quality", "fa"): ["fast"],
    ("unwarp", "a.png", "--to", "c"): ["cylinder"],
    ("export", "run", "--to", "col"): ["colmap", "colmap-binary"],
    ("dataset", "convert", "set", "--to", "co"): ["coco", "colmap", "colmap-binary"],
    ("validate", "--only", "r"): ["rings", "reflections", "rays", "response"],
    ("robot", "check", "s"): ["superscout"],
    ("record", "rings", "--trajectory-f"): ["--trajectory-frame"],
    ("video", ".", "--camera-name", "c"): ["cam0", "cam1"],  # of the run in this folder
    ("video", "none", "--camera-name", "c"): [],
    ("drive", "yard.toml", "--path", ""): ["round", "there"],
}


def test_names_are_completed(tmp_path):
    cameras = {name: {"type": "omnicamera"} for name in ("cam0", "cam1", "front")}
    sensors = {**cameras, "cam_imu": {"type": "imu"}}
    (tmp_path / "manifest.json").write_text(json.dumps({"sensors": sensors}))
    (tmp_path / "yard.toml").write_text('[[paths]]\nname = "round"\n[[paths]]\nname = "there"\n')
    assert dict(zip(COMPLETED, _ask(*COMPLETED, folder=tmp_path), strict=True)) == COMPLETED


def test_calibration_formats_are_completed_though_their_registry_takes_a_while():
    words = ("calibration", "convert", "a.yaml", "--to", "opencv_f")
    assert _ask(words, slow=()) == [["opencv_fisheye"]]


def test_built_in_names_are_those_of_the_modules():
    assert completion.complete_scene(None, "") == builtin_scenes()
    assert completion.complete_robot(None, "") == builtin_robots()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_script_for_each_shell_is_shown_and_installed_once(ran, shell, monkeypatch, tmp_path):
    text, _ = ran("--show-completion", shell)
    assert "_OMNISIM_COMPLETE" in text
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", f"/bin/{shell}")
    (tmp_path / f".{shell}rc").write_text("alias a=b")
    for _ in range(2):
        ran("--install-completion")
    (script,) = (path for path in tmp_path.rglob("omnisim.*") if path.is_file())
    assert script.read_text().rstrip() == text.rstrip()
    if shell != "fish":  # which reads a folder
        lines = (tmp_path / f".{shell}rc").read_text().splitlines()
        assert lines == ["alias a=b", "", f"source ~/{script.relative_to(tmp_path)}"]
