"""Identity of vehicles and routes: by what they were made from, wherever that is."""

import shutil

import pytest

from omnisim.core.files.sources import fingerprint
from omnisim.core.package_files import SCENES
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.route import Route, route_digest


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(SCENES / "p2at", tmp_path / "p2at")
    return tmp_path / "p2at"


def test_a_robot_is_the_same_in_another_folder(folder):
    assert fingerprint(Vehicle.load(folder)) == fingerprint(Vehicle.load("p2at"))


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("robot.toml", "resolution_deg = 0.5", "resolution_deg = 1"),
        ("omnicam.toml", "", "[degradation.defocus]\nrim_defocus_px = 1.0\n"),
    ],
)
def test_every_file_of_a_robot_counts(folder, file, old, new):
    before = fingerprint(Vehicle.load(folder))
    text = (folder / file).read_text()
    changed = text.replace(old, new, 1) if old else f"{text}\n{new}"
    (folder / file).write_text(changed)
    assert fingerprint(Vehicle.load(folder)) != before


def test_options_of_cameras_count():
    robot = Vehicle.load("p2at")
    small, smaller = robot.with_cameras(size_px=64), robot.with_cameras(size_px=48)
    assert len({fingerprint(one) for one in (robot, small, smaller)}) == 3
    assert fingerprint(robot.with_cameras(size_px=64)) == fingerprint(small)


def test_a_route_is_of_its_files_content_and_its_options(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "way.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    here, there = (Route(str(tmp_path / name / "way.csv")) for name in ("a", "b"))
    assert route_digest(here) == route_digest(there)
    assert route_digest(Route(here.path, step_m=0.1)) != route_digest(here)
    (tmp_path / "a" / "way.csv").write_text("x_m,y_m\n0,0\n2,0\n")
    assert route_digest(here) != route_digest(there)
    assert route_digest(Route("lap")) == route_digest(Route("lap", ground_m=None))
