"""Plain command lines: the same requests as typer's, and all else is left to typer."""

import shlex

import pytest

from omnisim.apps.cli.commands import COMMANDS
from omnisim.apps.cli.entries import Entry
from omnisim.apps.cli.plain_parser import parse
from omnisim.apps.cli.typer_app import app

PLAIN = (
    "render rings -o a.png",
    "render soccer --output a.png --size 24 --at 1 -2.5 3e-1 --yaw=-30 --quality fast --unlit",
    "render --also range,flow a/b.toml --channel-format npy --boxes-3d -o b.png --next 0 0 .5",
    "render a.glb -o a.png --resources x --resources y/z --backend rays --not-mirrored --device 2",
    "render a.glb -o a.png -n auto --preset dragonfly2 --seed -3 --size 24 --size 30 --axes kitti",
    "drive soccer --robot a --path b --robot c --path d -o run --force --step 0.1",
    "scan soccer -o scan.csv --time 5",
    "unwarp a.png --to cylinder -o b.png",
    "live --port 0 --record a.mp4",
    "robot check superscout",
    "scene show courtyard",
    "sensor",
    "sensor --check a.toml",
)
NOT_PLAIN = (
    "", "--version", "--help", "render", "render --help", "nosuch", "scene courtyard",
    "render a.glb",
    "render a.glb -o", "render a.glb b.glb -o a.png", "render a.glb -oa.png",
    "render a.glb -o a.png --siz 24", "render a.glb -o a.png --size 1.5",
    "render a.glb -o a.png --size=", "render a.glb -o a.png --size 1_0", "render -- a.glb -o a.png",
    "render a.glb -o a.png --at 1 2", "render a.glb -o a.png --at 1 2 x", "render '' -o a.png",
    "render a.glb -o a.png --device -1", "render a.glb -o a.png --backend ray",
    "render a.glb -o a.png --yaw nan", "render a.glb -o a.png --yaw inf", "render a.glb -o --unlit",
    "render a.glb -o a.png --unlit=1", "live --port 70000", "info 3",
)  # fmt: skip


@pytest.mark.parametrize("line", PLAIN)
def test_requests_are_those_of_typer(monkeypatch, line):
    words = shlex.split(line)
    called = []
    monkeypatch.setattr(Entry, "call", lambda self, *how: called.append((self, *how)) or 0)
    app(words, prog_name="omnisim", standalone_mode=False)
    plain = parse(words, COMMANDS)
    assert [(plain.entry, plain.path, plain.request)] == called
    assert repr(plain.request) == repr(called[0][2])  # 1 equals 1.0


@pytest.mark.parametrize("line", NOT_PLAIN)
def test_other_command_lines_are_left_to_typer(line):
    assert parse(shlex.split(line), COMMANDS) is None
