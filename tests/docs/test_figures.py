"""Figures of the documentation, against the code that they are made from."""

import importlib
import re
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from omnisim.apps.cli.app import main
from omnisim.core.errors import SceneError
from omnisim.datasets.generate.shard import shard_stem
from omnisim.scene.files.readers import check_format

NUMBER = re.compile(r"-?\d+\.\d+")
RENEW = "run `python docs/_ext/figures.py`"
ROOT = Path(__file__).resolve().parents[2]
POSES = "0 0 0 1 0 0 0 1\n1 0.1 0 1 0 0 0 1\n"
PLAN = """
channels = ["range"]
images_per_shard = 2
shards = 1
[[scenes]]
file = "rings"
[[cameras]]
name = "mirror"
size_px = 32
[viewpoints]
where = "poses"
file = "poses.tum"
"""


@pytest.fixture
def extension(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_ext"))
    return importlib.import_module


@contextmanager
def _entered():
    """Qualified names of functions in the order in which they are first entered."""
    names = {}

    def profile(frame, event, _):
        if event == "call" and "/omnisim/" in (path := frame.f_code.co_filename):
            module = path.rpartition("/omnisim/")[2].removesuffix(".py").replace("/", ".")
            names.setdefault(f"{module}:{frame.f_code.co_qualname}", len(names))

    sys.setprofile(profile)
    threading.setprofile(profile)  # of the thread that writes
    try:
        yield names
    finally:
        sys.setprofile(None)
        threading.setprofile(None)


def test_figures_are_those_of_the_code(extension):
    for path, text in extension("figures").figures():
        stored = path.read_text("utf-8")
        assert NUMBER.sub("", stored) == NUMBER.sub("", text), RENEW
        # a tenth of a pixel may be rounded differently on another processor
        coordinates = ([float(one) for one in NUMBER.findall(each)] for each in (stored, text))
        assert np.allclose(*coordinates, rtol=0.0, atol=0.11), RENEW


def test_objects_in_the_figure_exist(extension):
    for node in extension("object_figure").NODES:
        if node.module is None:
            assert node.name == f"{shard_stem(0)}.tar"
            continue
        name, _, attribute = node.name.partition(".")
        kind = getattr(importlib.import_module(node.module), name)
        assert not attribute or attribute in kind.__annotations__


def _complaint(path):
    try:
        check_format(path)
    except SceneError as error:
        return str(error)
    return None


def test_worlds_in_the_figure_are_read(extension, tmp_path):
    for suffix in extension("exchange_figure").WORLDS:
        (world := tmp_path / f"world{suffix}").write_text("<mujoco/>")
        complaint = _complaint(world)
        assert complaint is None or "pip install" in complaint  # read with an extra


def test_figures_have_one_style_in_light_and_dark(extension):
    style = extension("figure_style").svg("any", 1, []).partition("<style>")[2].partition("</")[0]
    colors = re.findall(r"--(\w+): #", style)
    assert colors[: len(colors) // 2] == colors[len(colors) // 2 :]
    drawn = {path for path in (ROOT / "docs").rglob("*.svg") if "_build" not in path.parts}
    for path in drawn:
        text = path.read_text("utf-8")
        assert f"<style>{style}</style>" in text, path
        inside = text.partition("</defs>")[2]
        assert not re.search(r"(fill|stroke|color)[=:]\s*\"?(#|rgb|white|black)", inside), path
    assert {path for path, _ in extension("figures").figures()} <= drawn


def test_the_first_figure_shows_the_files_of_the_first_command():
    page = (ROOT / "docs" / "index.md").read_text("utf-8")
    channels = re.search(r"--also (\S+) .*-o frame.png$", page, re.MULTILINE)[1].split(",")
    names = ["frame.png", *(f"frame.{name}.png" for name in channels)]
    figure = (ROOT / "docs" / "first.svg").read_text("utf-8")
    assert re.findall(r">(frame[^<]*)</text>", figure) == names, "run `make sheets`"


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(
    ("subject", "command"),
    [
        ("a frame", "render rings --size 32 -o a.png"),
        ("a hit", "render rings --size 32 --also range -o a.png"),
        ("a run", "drive soccer --robot superscout --path lap --size 24 --quality fast --step 3 "
                  "--turn-step 90 -o run"),
        ("a shard", "generate plan.toml -o set"),
    ],
)  # fmt: skip
def test_ways_are_entered_in_the_order_of_the_figure(
    extension, monkeypatch, tmp_path, subject, command
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.toml").write_text(PLAN)
    (tmp_path / "poses.tum").write_text(POSES)
    monkeypatch.setattr(sys, "argv", ["omnisim", *command.split()])
    with _entered() as names, pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    steps = extension("architecture_figures").WAYS[subject]
    assert not [step for step in steps if step not in names]
    assert sorted(steps, key=names.__getitem__) == list(steps)
