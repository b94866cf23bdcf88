"""Every command creates the folders of what it writes."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from omnisim.apps.cli.options import ENTRIES
from omnisim.apps.doctor import OK, Finding
from omnisim.cameras.optics import read_optics_file, write_corners
from tests.apps.cli import test_usage_errors  # noqa: F401 - imports the requests of all commands
from tests.apps.cli.measure.conftest import write_series
from tests.cameras.optics.boards.test_calibrate import boards_of
from tests.datasets.plans import write_plan

EXAMPLES = Path(__file__).parents[3] / "examples"
# Commands in their order; later ones read what earlier ones wrote. `N` is a new folder each.
COMMANDS = """
render rings -o N/a.png --size 32 --quality fast --faces N/f --rays N/r.exr --calibration N/c.json
render rings -o first.png --size 64 --quality fast
scan rings -o N/s.csv --plot N/s.png
unwarp first.png --to cylinder -o N/p.png
mirror -o N/m.glb -n 64
calibration convert first.png --to omnisim -o N/c.json
calibration check first.png -o N/check
serve superscout --scene rings --protocols plain --port 0 --fast --duration 0.05 --commands N/c.csv
optics plot ball.toml -o N/o.png
optics rays ball.toml -o N/o.exr
optics design -o N/d.csv --distance 0.1 --half-angle 20 --equi-angular 105
optics profile ball.toml -o N/p.csv
optics calibrate ball.toml corners.csv --free camera.focal_length_px -o N/o.toml
scene show rings --plot N/s.png
scene convert rings -o N/s.glb
robot import robot.ini -o N/r.toml
drive soccer --robot superscout --path path.csv --size 64 --quality fast --step 1 -o N/run
drive soccer --robot superscout --path path.csv --size 64 --step 0.4 --also semantic,instance -o run
record rings --trajectory poses.tum --size 32 --quality fast -o N/rig
plot run -o N/p.png
video run -o N/v.mp4
export run --to tum -o N/tum
landmarks train run -o N/m.npz
landmarks train run -o m.npz
landmarks detect run --model m.npz -o N/d.csv --show N/d.png
localize run -o N/l
evaluate run --with wheels -o N/e
generate plan.toml -o N/set
generate plan.toml -o set
dataset convert set -o N/coco
dataset view set -o N/v.png --count 1
bake a.obj -o N/b --samples 1
measure response series -o N/c.toml
doctor --report N/d.json
"""
# Slow, or of inputs that other tests make: measure geometry and compare, noise, timing, sharpness
# and plan; the validation and the experiments; a film of the live page.
ELSEWHERE = {
    "measure geometry", "measure noise", "measure timing", "measure sharpness", "measure plan",
    "measure compare", "validate", "experiments", "live",
}  # fmt: skip
WRITTEN = re.compile(
    r"to write|^Folder (for|of the (run|data|report))|^New |^Also (plot|write|draw)|^JSON|^Image: "
)


def _outputs():
    """Commands with each of their options that names a file or a folder to write."""
    for path, entry in ENTRIES.items():
        for field in entry.fields:
            is_path = Path in field.kinds and not field.is_argument
            if is_path and WRITTEN.search(" ".join(field.text.split())):
                yield path, field.flags


@pytest.fixture
def inputs(tmp_path):
    shutil.copy(EXAMPLES / "optics" / "sphere.toml", tmp_path / "ball.toml")
    ball = read_optics_file(tmp_path / "ball.toml")
    write_corners(tmp_path / "corners.csv", boards_of(ball, 3))
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "path.csv").write_text("x_m,y_m\n0,0\n2,0\n")
    (tmp_path / "poses.tum").write_text("0 0 0 1 0 0 0 1\n1 0.1 0 1 0 0 0 1\n")
    write_plan(tmp_path, images_per_shard=1, shards=1, channels=["range", "instance", "semantic"])
    write_series(tmp_path / "series", lambda light: light**0.5)
    sample = Path(__file__).parents[2] / "robots" / "importers" / "usarsim" / "sample.ini"
    text = sample.read_text().split("[USARBot.P2DX]")[0]
    (tmp_path / "robot.ini").write_text(text)


@pytest.mark.slow
@pytest.mark.long
def test_commands_create_the_folders_of_their_outputs(
    omnisim, inputs, tmp_path, monkeypatch, needs_opengl
):
    from omnisim.apps.cli.checks import doctor

    fine = Finding(OK, "Mesa, llvmpipe")
    monkeypatch.setattr(doctor, "run_step", lambda name, *_: doctor.DoctorStep(name, 1.0, fine))
    missing = []
    for number, line in enumerate(COMMANDS.strip().splitlines()):
        folders = iter(range(9))
        words = [
            re.sub("^N/", f"new-{number}-{next(folders)}/x/", word)
            if word.startswith("N/")
            else word
            for word in shlex.split(line)
        ]
        status, _, error = omnisim(*words)
        written = [word for word in words if word.startswith("new-")]
        if status or not all((tmp_path / one).exists() for one in written):
            missing.append((line, error))
    assert missing == []


def test_no_command_that_writes_is_left_out():
    covered = {
        (path, flag)
        for line in COMMANDS.strip().splitlines()
        for path in {" ".join(line.split()[:2]), line.split()[0]}
        for flag in re.findall(r"(--?[\w-]+) N/", line)
    }
    left_out = {
        path
        for path, flags in _outputs()
        if path not in ELSEWHERE and not any((path, flag) in covered for flag in flags)
    }
    assert left_out == set()
