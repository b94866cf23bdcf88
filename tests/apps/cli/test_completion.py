"""Shell completion, as a shell asks for it."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from omnisim.apps.cli import completion
from omnisim.cameras.catalog.lens_catalog import catalog
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
    ("render", "rings", "--also", "range,ran"): ["range,range_through"],
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
    ("render", "rings", "--camera", "c"): ["catalog:"],  # besides files
    ("calibration", "show", "catalog:gopro/hero11-black/wide-3840x21"): [
        "catalog:gopro/hero11-black/wide-3840x2160"
    ],
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


def test_cameras_of_the_catalog_are_completed_level_by_level():
    def completed(word):
        return completion.complete_camera(None, word)

    split = [name.split("/") for name in catalog()]
    makers = sorted({f"catalog:{maker}/" for maker, _, _ in split})
    assert sorted(completed("catalog:")) == makers
    models = {f"catalog:gopro/{model}/" for maker, model, _ in split if maker == "gopro"}
    assert set(completed("catalog:gopro/")) == models
    assert set(completed("catalog:gopro/hero11")) == {
        model for model in models if model.startswith("catalog:gopro/hero11")
    }
    modes = completed("catalog:gopro/hero11-black/")
    assert modes == [f"catalog:{name}" for name in catalog() if "/hero11-black/" in name]
    assert completed("catalog:no-maker/") == []


# A line, its completions, and the arguments of bash's compopt.
BASH = [
    ("render rings --camera cat", ["catalog:", "cat.yaml", "cats/"], []),
    ("render rings --camera catal", ["catalog:"], ["-o nospace"]),
    ("render rings --camera catalog:insta3", ["insta360/"], ["-o nospace"]),
    ("render rings --camera=catalog:insta3", ["insta360/"], ["-o nospace"]),
    ("render rings --camera my", [], ["-o default"]),
    ("render comp", ["compass"], []),
    ("drive rings --robot ", ["p2at", "superscout", "cat.yaml", "cats/", r"my\ lens.yaml"], []),
    ("export run --to col", ["colmap", "colmap-binary"], []),
]


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
@pytest.mark.parametrize(("line", "words", "options"), BASH, ids=[line for line, *_ in BASH])
def test_bash_completes_names_and_files_together_and_words_with_colons(
    ran, line, words, options, tmp_path
):
    (tmp_path / "here" / "cats").mkdir(parents=True)
    for name in ("cat.yaml", "my lens.yaml"):
        (tmp_path / "here" / name).touch()
    script, _ = ran("--show-completion", "bash")
    program = f"{sys.executable} -c 'from omnisim.apps.cli.app import main; main()'"
    (tmp_path / "omnisim").write_text(f"#!/bin/sh\nexec {program}\n")
    (tmp_path / "omnisim").chmod(0o755)
    ask = (
        f'complete() {{ :; }}; compopt() {{ echo "$1 $2" >&2; }}; {script}\n'
        f'COMP_LINE="omnisim {line}"; COMP_POINT=${{#COMP_LINE}}\n'
        '_omnisim_completion ../omnisim; printf "%s\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        ["bash", "-c", ask], cwd=tmp_path / "here", capture_output=True, text=True, check=True
    )
    assert sorted(done.stdout.split("\n")[:-1]) == sorted(words or [""])
    assert done.stderr.splitlines() == options


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_script_for_each_shell_is_shown_and_installed_once(ran, shell, monkeypatch, tmp_path):
    text, _ = ran("--show-completion", shell)
    assert "_OMNISIM_COMPLETE" in text
    assert shell != "zsh" or "compadd -U -S ''" in text  # no blank behind a part of a name
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
