"""Figures of the documentation, against the code that they are made from."""

import importlib
import re
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from omnisim.apps.cli.app import main

LABEL = re.compile(r"<text[^>]*>([^<]*)")
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
    try:
        yield names
    finally:
        sys.setprofile(None)


def test_the_rooms_and_ways_are_as_the_code_has_them(extension):
    for path, text in extension("architecture_figures").figures():
        assert path.read_text("utf-8") == text, "run `python docs/_ext/figures.py`"


def test_drawn_figures_have_the_labels_of_the_code(extension, tmp_path):
    extension("figures").write_figures(tmp_path)
    for path in tmp_path.glob("*.svg"):
        stored = ROOT / "docs" / "explanation" / "figures" / path.name
        made, kept = (
            re.findall(r"<text[^>]*>([^<]*)", one.read_text("utf-8")) for one in (path, stored)
        )
        assert made == kept, "run `python docs/_ext/figures.py`"
        assert len(made) > 5


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
