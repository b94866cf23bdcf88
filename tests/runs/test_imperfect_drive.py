"""Drives with cameras that are not ideal: killed and gone on with, they end the same."""

import dataclasses
import shutil

import numpy as np
import pytest

from omnisim.core.errors import RunError
from omnisim.core.files.image_files import read_image
from omnisim.core.trajectories import Trajectory
from omnisim.rendering.camera.degradations import Shutter, preset
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene
from tests.conftest import open_context_or_skip

ROUTE = Route("lap", step_m=2.5, step_deg=60.0)


@pytest.fixture(scope="module")
def scene():
    return load_scene("soccer")


@pytest.fixture(scope="module")
def vehicle():
    degradation = preset("dragonfly2")
    # slow enough to lag from step to step
    exposure = dataclasses.replace(degradation.exposure, time_constant_s=3.0)
    degradation = dataclasses.replace(degradation, exposure=exposure)
    loaded = Vehicle.load("p2at").with_cameras(degradation=degradation).with_cameras(size_px=48)
    return dataclasses.replace(loaded, sensors=loaded.cameras)


@pytest.fixture(scope="module")
def whole(scene, vehicle, tmp_path_factory):
    open_context_or_skip().release()
    folder = tmp_path_factory.mktemp("runs") / "whole"
    list(Drive(scene, vehicle, ROUTE, seed=7).plan().record(folder))
    return folder


def _images(folder):
    return [path.read_bytes() for path in sorted((folder / "omnicam").glob("*.png"))]


def _told(folder, step):
    return read_image(folder / "omnicam" / f"{step:06d}.png")[1]["degradation"]


def test_exposure_lags_by_what_the_images_tell(whole, scene, vehicle):
    truth = Drive(scene, vehicle, ROUTE, seed=7).plan().truth
    exposure = vehicle.camera().sensor.degradation.exposure
    exposures = [_told(whole, step)["exposure"] for step in range(len(truth))]
    assert exposures[0]["ev"] == exposures[0]["metered_ev"]  # it has settled where it starts
    for step in range(1, len(truth)):
        before = exposures[step - 1]
        later_s = truth.times_s[step] - truth.times_s[step - 1]
        assert exposures[step]["ev"] == exposure.next_ev(
            before["ev"], before["metered_ev"], later_s
        )
    assert np.ptp([one["ev"] for one in exposures]) > 0.02  # else this is no test
    assert any(_told(whole, step)["sub_frames"] > 1 for step in range(len(truth)))


@pytest.mark.parametrize("lost", [(0, 4), (1, 2, 3, 4, 5, 6, 7, 8)])
def test_what_is_missing_comes_back_with_the_same_bytes(whole, scene, vehicle, tmp_path, lost):
    folder = tmp_path / "run"
    shutil.copytree(whole, folder)
    for step in lost:
        (folder / "omnicam" / f"{step:06d}.png").unlink()
    list(Drive(scene, vehicle, ROUTE, seed=7).plan().record(folder))
    assert _images(folder) == _images(whole)


def test_another_seed_is_other_noise(whole, scene, vehicle, tmp_path):
    steps = Drive(scene, vehicle, ROUTE, seed=8).plan().record(tmp_path / "run")
    next(steps), next(steps)
    steps.close()
    one, other = (
        read_image(folder / "omnicam" / "000000.png")[0] for folder in (whole, tmp_path / "run")
    )
    assert np.mean(one != other) > 0.05
    assert np.abs(one.astype(int) - other).mean() < 8.0  # the same scene, though


def test_another_preset_is_another_run(whole, scene, vehicle):
    other = vehicle.with_cameras(degradation=preset("webcam"))
    # by the key that differs, not by a fingerprint
    words = r"sensors\.omnicam\.degradation\.defocus\.center_defocus_px was .*another run is in"
    with pytest.raises(RunError, match=words):
        next(Drive(scene, other, ROUTE, seed=7).plan().record(whole))


def test_an_image_without_exposure_is_named(whole, scene, vehicle, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(whole, folder)
    (folder / "omnicam" / "000003.png").write_bytes(b"no image")
    (folder / "omnicam" / "000004.png").unlink()
    with pytest.raises(RunError, match=r"000003\.png: has no exposure"):
        list(Drive(scene, vehicle, ROUTE, seed=7).plan().record(folder))


def test_an_exposure_longer_than_a_step_is_refused(scene, vehicle):
    long = dataclasses.replace(preset("webcam"), shutter=Shutter(exposure_s=5.0))
    drive = Drive(scene, vehicle.with_cameras(degradation=long), ROUTE)
    words = r"camera 'omnicam': .*exposure_s: expected at most .* to .*, got 5"
    with pytest.raises(RunError, match=words):
        drive.plan()


def test_poses_between_those_of_a_trajectory():
    path = Trajectory.on_ground([1.0, 2.0, 4.0], [[0, 0], [2, 0], [2, 0]], [0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(path.pose_at(1.25)[:3, 3], (0.5, 0.0, 0.0))
    turned = path.pose_at(3.0)
    np.testing.assert_allclose(turned[:2, 0], (np.sqrt(0.5), np.sqrt(0.5)))
    for time_s, step in ((-5.0, 0), (1.0, 0), (2.0, 1), (4.0, 2), (9.0, 2)):
        np.testing.assert_array_equal(path.pose_at(time_s), path.world_from_base[step])
