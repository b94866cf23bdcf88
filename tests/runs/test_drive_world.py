"""Drives with moving objects and several robots: what each sees, and what is on disk."""

import dataclasses
import json

import numpy as np
import pytest
import trimesh

from omnisim.core.files.image_files import read_channels
from omnisim.core.trajectories import read_trajectory
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive, drive_together
from omnisim.runs.route import Route
from omnisim.scene import load_scene
from omnisim.scene.model import ScenePath
from tests.runs.test_drive import _bytes

pytestmark = pytest.mark.usefixtures("needs_opengl")
TOML = """
extends = "soccer"
[[objects]]
name = "ball"
file = "ball.glb"
orbit = { center_m = [0.0, 0.0, 0.2], radius_m = 1.0, period_s = 20.0 }
rolling_radius_m = 0.2
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    trimesh.creation.icosphere(2, 0.2).export(folder / "ball.glb")
    (folder / "scene.toml").write_text(TOML)
    return load_scene(folder / "scene.toml")


@pytest.fixture
def plans(scene):
    """Two robots that meet in the middle of the field."""

    def plan(robot, sign):
        way = ScenePath("way", ((-2.0 * sign, -0.8 * sign), (1.0 * sign, -0.8 * sign)), None)
        vehicle = Vehicle.load(robot).with_cameras(size_px=48, quality="fast")
        route = Route("way", step_m=0.6, step_deg=90.0)
        drive = Drive(
            dataclasses.replace(scene, paths=(way,)), vehicle, route, channels=("instance",)
        )
        return drive.plan()

    return drive_together({"a": plan("p2at", 1.0), "b": plan("superscout", -1.0)})


def _seen(folder, step):
    labels = json.loads((folder / "labels.json").read_text())
    ids = read_channels(folder / "omnicam" / f"{step:06d}.channels.exr").values["instance"]
    seen = set(np.unique(ids).tolist())
    return {entry.get("object") for entry in labels["instances"] if entry["id"] in seen}, labels


def test_robots_see_each_other_and_the_ball(plans, tmp_path):
    for name, plan in plans.items():
        steps = list(plan.record(tmp_path / name))
        assert steps[-1] == len(plan.truth)
    for name, other in (("a", "b"), ("b", "a")):
        folder = tmp_path / name
        found = [_seen(folder, step)[0] for step in range(len(plans[name].truth))]
        assert any({other, "ball"} <= seen for seen in found), found
        labels = _seen(folder, 0)[1]
        vehicle = next(each["id"] for each in labels["classes"] if each["name"] == "vehicle")
        classes = {each.get("object"): each["class"] for each in labels["instances"]}
        assert classes[name] == classes[other] == vehicle != classes["ball"]
        # poses of all that moves, at the run's times
        truth = read_trajectory(folder / "ground_truth.tum")
        of_other = read_trajectory(folder / "objects" / f"{other}.tum")
        np.testing.assert_array_equal(of_other.times_s, truth.times_s)
        for k, time_s in enumerate(truth.times_s):
            wanted = plans[other].motion.pose_at(time_s)
            np.testing.assert_allclose(of_other.world_from_base[k], wanted, atol=1e-8)
        ball = read_trajectory(folder / "objects" / "ball.tum").positions_m
        np.testing.assert_allclose(np.linalg.norm(ball[:, :2], axis=1), 1.0, atol=1e-8)


@pytest.mark.slow
def test_a_run_in_a_world_resumes_to_the_same_bytes(plans, tmp_path):
    plan = plans["a"]
    list(plan.record(tmp_path / "whole"))
    steps = plan.record(tmp_path / "cut")
    next(steps), next(steps), next(steps)
    steps.close()
    for lost in ("objects/ball.tum", "omnicam/000001.png"):
        (tmp_path / "cut" / lost).unlink()
    list(plan.record(tmp_path / "cut"))
    assert _bytes(tmp_path / "cut") == _bytes(tmp_path / "whole")
    # another world is another run, and --force removes all that is the run's
    alone = plan.drive.plan()
    list(alone.record(tmp_path / "cut", force=True))
    assert not (tmp_path / "cut" / "objects" / "b.tum").exists()
    assert (tmp_path / "cut" / "objects" / "ball.tum").exists()
