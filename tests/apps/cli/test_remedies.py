"""Messages that say what to do, against commands that do it: the fault is gone.

Most are done by a rule: the nearest name, the example, the option that is required or one too many
are put in as the line has them. `BY_HAND` has the others. A line with a remedy that neither has is
found missing.
"""

import difflib
import re
import shlex
import shutil
import sys
import tomllib
from pathlib import Path

import pytest

from omnisim.apps.cli.command import Command
from omnisim.apps.cli.options import ENTRIES, CommandLineError
from omnisim.cameras.calibration import calibration_of
from omnisim.core.errors import OmnisimError
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.apps.cli import test_usage_errors  # noqa: F401 - imports the requests of all commands
from tests.apps.cli.image_files import write_images

TABLE = tomllib.loads(Path(__file__).with_name("messages.toml").read_text(encoding="utf-8"))
MESSAGES = {command: line for kind in TABLE["messages"].values() for command, line in kind.items()}
REMEDY = re.compile(
    r"did you mean|\bpass\b|requires|expected with|such as|expected one of them|\bneed\b"
    r"|make a mesh|choose another direction|change the size|expected \S+ (\S+ )?beside"
    r"|unexpected argument|as `omnisim"
)
VALUES = {  # of options that a line requires without a value
    "--camera": "--camera lens.json", "--scene": "--scene a.obj",
    "--trajectory": "--trajectory p.tum",
    "--board": "--board 8x6:30mm", "--also": "--also range", "--height": "--height 1",
    "--size": "--size 64 48",
}  # fmt: skip
BY_HAND = {
    "render points.ply -o o.png": "render a.obj -o o.png",
    "optics design -o p.csv --distance 0.1 --half-angle 20 --equi-angular 105 --size 90":
        "optics design -o p.toml --distance 0.1 --half-angle 20 --equi-angular 105 --size 90",
    "render a.obj --optics none.csv -o o.png": "render a.obj --optics ball.toml -o o.png",
    "render a.obj -o o.png --sensor two-balls.toml": "render a.obj -o o.png --optics ball.toml",
    "render a.obj -o o.png --sensor balls.toml": "render a.obj -o o.png --optics ball.toml",
    "render a.obj -o o.png --camera mirror.toml": "render a.obj -o o.png --sensor good.toml",
    "render a.obj -o o.png --sensor empty.yaml": "render a.obj -o o.png --camera lens.json",
    "render empty.yaml -o o.png": "render a.obj --camera lens.json -o o.png",
    "render a.obj -o o.png --camera a.obj": "render a.obj -o o.png",
    "calibration show a.obj": "render a.obj -o o.png",
    "measure compare . --sensor unlit.toml -o r":
        "measure compare . --sensor unlit.toml --board 8x6:30mm -o r",
    "measure timing . --board 8x6:30mm -o c.toml":
        "measure timing . --board 8x6:30mm --sensor unlit.toml --frame-rate 30 -o c.toml",
    "measure timing . --board 8x6:30mm --sensor unlit.toml -o c.toml":
        "measure timing . --board 8x6:30mm --sensor unlit.toml --frame-rate 30 -o c.toml",
    "unwarp a.png --to perspective -o o.png --pitch -80 --fov 40":
        "unwarp a.png --to perspective -o o.png --pitch 10 --fov 40",
    "unwarp a.png --to cylinder -o o.png --size 90 9":
        "unwarp a.png --to cylinder -o o.png --size 90 18",
    "unwarp below.png --to birdseye -o o.png": "unwarp below.png --to birdseye -o o.png --height 2",
    "robot check phase.toml": "robot check rated.toml",
    "measure geometry . --board 8:30mm -o c.toml": "measure geometry . --board 8x6:30mm -o c.toml",
    "dataset convert none -o o --split train":
        "dataset convert none -o o --split train=0.8,val=0.2",
    "dataset convert none -o o --split a=0.5,a=0.5":
        "dataset convert none -o o --split train=0.8,val=0.2",
    "export none --to euroc -o o --start-time noon":
        "export none --to euroc -o o --start-time 2026-01-31T12:00:00",
    "calibration convert a.png --optics ball.toml --to ros -o o.yaml":
        "calibration convert a.png --to omnisim -o o.json",
    "render a.obj -o o.png --device 77": "render a.obj -o o.png --device 0",
    "render a.obj -o o.png --device 99999999999": "render a.obj -o o.png --device 0",
}  # fmt: skip
FILES = {
    "good.toml": "[mirror]\nk = 5.0\n",
    "p.tum": "0 0 0 1 0 0 0 1\n",
    "rated.toml": TABLE["files"]["phase.toml"] + "rate_hz = 5.0\n",
}


def _without(words, flag):
    """Words without an option and its values."""
    kept, is_value = [], False
    for word in words:
        is_value = word.split("=")[0] == flag or (is_value and not re.match(r"-[a-z-]", word))
        if not is_value:
            kept.append(word)
    return kept


def _tried(command, line):
    """Command that does what a line says; None: not by a rule."""
    words = shlex.split(command)
    if command in BY_HAND:
        return shlex.split(BY_HAND[command])
    if found := re.match(r"(--\S+): expected one of (\w+).*, got nothing", line):
        return [*_without(words, found[1]), found[1], found[2]]
    if found := re.search(r"did you mean '(.+?)'", line):
        options = [word.partition("=")[0] for word in words]
        (near,) = difflib.get_close_matches(found[1], options, 1, 0.1)
        return [re.sub(rf"^{re.escape(near)}(?==|$)", found[1], word) for word in words]
    if found := re.match(r"(\S+): unexpected argument", line):
        return [word for word in words if word != found[1]]
    if found := re.search(r"missing: .*, such as omnisim (.*)$", line):
        return shlex.split(found[1])
    if found := re.search(r"missing: .*, such as (-.*)$", line):
        return [*words, *shlex.split(found[1])]
    if found := re.search(r"(?:such as|: expected) (--?[a-z].*?), got (.*)$", line):
        flag = found[1].split()[0]
        return [*_without(words, flag), *shlex.split(found[1])]
    if found := re.search(r"such as ([\d.]+), got (.*)$", line):
        return [found[1] if word == found[2] else word for word in words]
    if found := re.match(r"(\S+), (\S+): expected one of them, got both", line):
        return _without(words, found[2])
    if found := re.search(r"(?:requires|with|needs?|expected) (--[a-z-]+)(?: ([a-z_]+)\b)?", line):
        value = f"{found[1]} {found[2]}" if found[2] else VALUES[found[1]]
        if found[2] in ("beside", "a"):
            value = VALUES[found[1]]
        return [*_without(words, found[1]), *shlex.split(value)]
    return None


def _tried_in_files(line):
    """File whose text a line changes, the word in it, and the new one."""
    found = re.match(r"(\S+\.toml): (\S+): unknown key; did you mean '(.+)'", line)
    found = found or re.match(r"(\S+\.toml): .* = '(\w+)': .*; did you mean '(.+)'", line)
    return None if found is None else found.groups()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Folder of the table's files, images and a calibration."""
    folder = tmp_path_factory.mktemp("files")
    write_images(folder)
    for name, text in (TABLE["files"] | FILES).items():
        (folder / name).write_text(text, encoding="utf-8")
    calibration_of(OmniCamera().model).save(folder / "lens.json", "omnisim")
    return folder


@pytest.fixture
def inputs(files, tmp_path):
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)


@pytest.fixture
def without_work(monkeypatch):
    """Commands end where they would render, or ask a cluster."""
    from omnisim.rendering import stage

    def begin(*_, **__):
        raise OmnisimError("work begins")

    monkeypatch.setattr(stage.Stage, "__init__", begin)
    monkeypatch.setitem(sys.modules, "ray", None)


@pytest.mark.parametrize("command", [one for one, line in MESSAGES.items() if REMEDY.search(line)])
def test_the_fault_is_gone(omnisim, inputs, without_work, tmp_path, command):
    line = MESSAGES[command]
    words = shlex.split(command)
    if change := _tried_in_files(line):
        name, old, new = change
        path = tmp_path / name
        path.write_text(re.sub(rf"\b{old}\b", new, path.read_text(encoding="utf-8")))
    elif (words := _tried(command, line)) is None:
        pytest.fail(f"{line}: expected a rule or an entry of BY_HAND")
    status, _, error = omnisim(*words)
    first = line.split("\n")[0]
    assert first not in error, words
    fault = first.split(":")[0] if first.startswith("-") else first.partition("; did you mean")[0]
    assert f"error: {fault}" not in error, (words, error)
    assert status in (0, 1), (words, error)


def _fault_of(words, known):
    """Message of a command line; empty: it is understood."""
    path = next((key for key in known if tuple(words[: len(key)]) == key), None)
    if path is None:
        assert words[0] in {key[0] for key in known} or words[0].startswith("--"), words
        return ""
    try:
        known[path].make_context(path[-1], words[len(path) :])
    except CommandLineError as reason:
        return str(reason)
    return ""


@pytest.mark.parametrize(
    "command", [one for one, line in TABLE["usage"].items() if REMEDY.search(line)]
)
def test_the_command_line_is_understood(command):
    """Remedies are tried one after the other, where a command line has several faults."""
    known = {tuple(path.split()): Command(entry) for path, entry in ENTRIES.items()}
    line, faults, tried = TABLE["usage"][command], [], command
    while line:
        faults.append(line)
        words = _tried(tried, line)
        assert words is not None, (tried, line)
        line, tried = _fault_of(words, known), shlex.join(words)
        assert line not in faults, tried
