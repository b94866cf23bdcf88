"""Depth cameras: noise by their formulas, shadows by their geometry, and runs that go on."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim import open_sensor
from omnisim.core.errors import OpticsError, RobotFileError
from omnisim.core.files.image_files import read_image
from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory
from omnisim.rendering.stage import Stage
from omnisim.robots import parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene
from omnisim.scene.model import Material
from omnisim.sensors.depth_camera.depth_camera import DepthCamera
from tests.ray_casting import RayCaster, opaque_part
from tests.scenes import scene_of
from tests.vehicles import box, scaled

DEVICES = {"kinect_v1": DepthCamera.kinect_v1(), "d435": DepthCamera.d435()}
CAMERA = {"name": "depth", "type": "depth_camera", "position_m": [0.0, 0.0, 0.3]}
every_device = pytest.mark.parametrize("camera", DEVICES.values(), ids=DEVICES)


def plane(camera, z_m):
    """True depths of a plane across the axis, in both views, and the cosines of an even one."""
    shape = (camera.height_px, camera.width_px)
    second = np.full((camera.height_px, camera.second_width_px), z_m, np.float32)
    return np.full(shape, z_m, np.float32), second, np.ones(shape, np.float32)


@every_device
def test_noise_grows_with_the_square_of_depth(camera):
    for z_m in (0.8, 4.5):
        measured = camera.measure(*plane(camera, z_m), seed=3)
        errors = measured[measured > 0.0].astype(np.float64) - z_m
        # to first order; the second is sigma/z of it, and rounding is not even for a small noise
        expected = camera.disparity_sigma_px * z_m**2 / (camera.focal_length_px * camera.baseline_m)
        assert camera.sigma_m(z_m) == pytest.approx(expected)
        rounding = 0.12 if camera.disparity_step_px > camera.disparity_sigma_px else 0.0
        assert errors.std() == pytest.approx(expected, rel=0.01 + 3.0 * expected / z_m + rounding)
        assert abs(errors.mean()) < 0.3 * expected


def test_the_kinects_noise_is_that_of_khoshelham_and_elberink():
    # their Eq. 9 has centimeters: 1.425e-5 z²; 7 cm between depths at 5 m
    kinect = DepthCamera.kinect_v1()
    for z_m in (1.0, 3.0, 5.0):
        assert 100.0 * kinect.sigma_m(z_m) == pytest.approx(1.425e-5 * (100.0 * z_m) ** 2, rel=0.01)
    depths = np.unique(kinect.measure(*plane(kinect, 4.9)))
    steps = np.diff(depths[(depths > 4.7) & (depths <= 5.0)])
    assert steps.max() == pytest.approx(0.07, abs=0.003)
    disparities = 580.0 * 0.075 / depths[depths > 0.0]
    np.testing.assert_allclose(8.0 * disparities, np.round(8.0 * disparities), atol=1e-4)
    fields = np.degrees(2.0 * np.arctan(np.array([320.0, 240.0]) / kinect.focal_length_px))
    np.testing.assert_allclose(fields, (57.0, 43.0), atol=2.5)  # the maker's


def test_the_d435s_noise_is_intels():
    camera = DepthCamera.d435()
    assert camera.sigma_m(2.0) == pytest.approx(4.0 * 0.08 / (424.0 * 0.05))
    assert camera.sigma_m(2.0) < 0.02 * 2.0  # at most 2 % at 2 m, the data sheet
    assert camera.range_min_m == pytest.approx(0.168, abs=5e-4)
    assert math.degrees(2.0 * math.atan(424.0 / camera.focal_length_px)) == pytest.approx(90.0)


@every_device
def test_noise_follows_from_seed_and_frame(camera):
    first = camera.measure(*plane(camera, 2.0), seed=1, frame_number=5)
    assert np.array_equal(first, camera.measure(*plane(camera, 2.0), seed=1, frame_number=5))
    for seed, number in ((2, 5), (1, 6)):
        other = camera.measure(*plane(camera, 2.0), seed=seed, frame_number=number)
        both = (first > 0.0) & (other > 0.0)
        apart = np.corrcoef(first[both], other[both])[0, 1]
        assert abs(apart) < 5.0 / math.sqrt(np.count_nonzero(both))


@every_device
def test_out_of_range_is_a_hole(camera):
    exact = camera.without_noise()
    for z_m, is_hole in (
        (camera.range_min_m * 0.99, True),
        (camera.range_min_m * 1.01, False),
        (camera.range_max_m * 0.99, False),
        (camera.range_max_m * 1.01, True),
        (np.inf, True),
    ):
        middle = exact.measure(*plane(exact, z_m))[:, exact.width_px * 2 // 3]
        assert np.all((middle == 0.0) == is_hole), z_m


def wall_and_box(wall_m, box_m):
    """A wall across the axis, and a box with its face nearer: 0.4 m wide."""
    meshes = [box("wall", 0), box("box", 0)]
    poses = [
        scaled(pose((wall_m + 0.05, 0.0, 0.0)), 0.1, 40.0, 40.0),
        scaled(pose((box_m + 0.005, 0.0, 0.0)), 0.01, 0.4, 0.4),
    ]
    return scene_of(meshes, [Material(double_sided=True)], poses)


@pytest.mark.usefixtures("needs_opengl")
@every_device
def test_without_noise_it_is_the_channel_z_and_holes_are_shadows(camera):
    camera = dataclasses.replace(camera, height_px=240)
    exact, scene = camera.without_noise(), wall_and_box(3.0, 1.2)
    with Stage(scene) as stage:
        with stage.open(exact) as renderer:
            depths = renderer.measure(np.eye(4)).depths_m
        with stage.open(exact.model) as renderer:
            true = renderer.render(np.eye(4), also=("z",)).channels["z"]
    holes = depths == 0.0
    assert np.array_equal(depths[~holes], true[~holes])
    row, middle = holes[camera.height_px // 2], 0.5 * (camera.width_px - 1)
    disparity_px = camera.focal_length_px * camera.baseline_m
    shadow_px = disparity_px * (1.0 / 1.2 - 1.0 / 3.0)
    left_edge = middle - camera.focal_length_px * 0.2 / 1.2
    shadow = np.flatnonzero(row & (np.arange(camera.width_px) > 100))
    # to the left of the box, as the second view is to the right; to the pixel at both ends
    assert len(shadow) == pytest.approx(shadow_px, abs=1.0)
    assert shadow.max() == pytest.approx(left_edge, abs=1.0)
    assert np.array_equal(shadow, np.arange(shadow.min(), shadow.max() + 1))
    # above the box only what a second camera does not see, at the edge
    band = np.flatnonzero(holes[2])
    expected = round(disparity_px / 3.0) if camera.is_stereo else 0
    assert len(band) == pytest.approx(expected, abs=1.0)
    assert not len(band) or band.max() < expected + 1


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
@every_device
def test_holes_are_what_embrees_rays_from_the_second_view_do_not_reach(camera):
    scene = opaque_part(load_scene("mapping"))
    caster, world_from_base = RayCaster(scene), pose((4.0, 3.0, 1.0), yaw_deg=200.0)
    exact = dataclasses.replace(
        camera.without_noise(), range_min_m=0.1, range_max_m=50.0, max_incidence_deg=90.0
    )
    with Stage(scene) as stage:
        with stage.open(exact) as renderer:
            depths = renderer.measure(world_from_base).depths_m
        with stage.open(exact.model) as renderer:
            channels = renderer.render(world_from_base, also=("z", "position")).channels
    beside = (world_from_base @ (0.0, -exact.baseline_m, 0.0, 1.0))[:3]
    there = np.isfinite(channels["z"])
    rays = channels["position"][there] - beside
    lengths_m = np.linalg.norm(rays, axis=1)
    reached = np.zeros(depths.shape, dtype=bool)
    _, ranges_m, _ = caster.hits(beside, rays / lengths_m[:, None])
    reached[there] = ranges_m > (1.0 - 1e-3) * lengths_m
    if exact.is_stereo:
        shift_px = exact.focal_length_px * exact.baseline_m / channels["z"]
        reached &= np.arange(exact.width_px) - shift_px >= -0.5
    assert 0.05 < np.mean(~reached[there]) < 0.15
    wrong = (reached != (depths > 0.0)) & there
    # half a pixel of the second view is as near as it can say; measured: 0.36 % and 0.17 %
    assert np.mean(wrong) < 0.005
    beside_edge = (reached != np.roll(reached, 1, axis=1)) | (
        reached != np.roll(reached, -1, axis=1)
    )
    # where shadows are a pixel wide or less; measured: 0.09 % and 0.03 %
    assert np.mean(wrong & ~beside_edge) < 0.0015


# A Kinect with a quarter of the pixels along each side.
SMALL = dataclasses.replace(
    DepthCamera.kinect_v1().without_noise(), width_px=160, height_px=120, focal_length_px=145.0
)


def depths_of_wall(place, mount=None):
    wall = scene_of([box("wall", 0)], [Material(double_sided=True)], [place])
    with open_sensor(wall, SMALL, base_from_sensor=mount) as renderer:
        return renderer.measure(np.eye(4)).depths_m


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(("yaw_deg", "is_hole"), [(70.0, False), (78.5, False), (82.0, True)])
def test_a_wall_at_a_grazing_angle_is_a_hole(yaw_deg, is_hole):
    # turned about its middle, 1.5 m ahead
    depths = depths_of_wall(scaled(pose((1.5, 0.0, 0.0), yaw_deg=yaw_deg), 1e-4, 4.0, 4.0))
    assert np.all((depths[50:70, 79:81] == 0.0) == is_hole)
    # a slanted wall casts no shadow on itself; farther to the right it is seen at more than 80°
    if yaw_deg == 70.0:
        assert np.count_nonzero(depths[60, 50:100] == 0.0) == 0


@pytest.mark.usefixtures("needs_opengl")
def test_the_camera_is_where_it_is_mounted():
    mount = pose((0.5, 0.1, 0.4), yaw_deg=90.0)
    depths = depths_of_wall(scaled(pose((0.5, 2.1, 0.4)), 9.0, 0.2, 9.0), mount)
    np.testing.assert_allclose(depths[60, 25:150], 1.9, atol=1e-5)


def vehicle_of(**keys):
    return Vehicle.from_robot(parse_robot({"name": "a", "sensors": [CAMERA | keys]}, "robot"))


@pytest.mark.usefixtures("needs_opengl")
def test_a_run_goes_on_with_the_same_bytes(tmp_path):
    vehicle = vehicle_of(width_px=160, height_px=120, focal_length_px=145.0)
    poses = np.stack([pose((0.3 * step, 0.0, 0.0), yaw_deg=20.0 * step) for step in range(3)])
    truth = Trajectory(np.arange(3.0), poses)
    drive, run = Drive(load_scene("soccer"), vehicle, Route("lap"), seed=3), tmp_path / "run"
    assert list(drive.along(truth).record(run))[-1] == 3
    files = sorted((run / "depth").iterdir())
    assert [file.name for file in files] == [
        "000000.png", "000001.png", "000002.png", "calibration.json"
    ]  # fmt: skip
    before = [file.read_bytes() for file in files]
    files[1].unlink()
    assert list(drive.along(truth).record(run)) == [2, 3]
    assert [file.read_bytes() for file in files] == before
    pixels, _ = read_image(files[2])
    assert pixels.dtype == np.uint16
    (mount,) = vehicle.sensors
    place = mount.base_from_sensor
    with open_sensor(drive.scene, mount.sensor, base_from_sensor=place, seed="3 depth") as renderer:
        depths = renderer.measure(poses[2], 2).depths_m
    assert np.count_nonzero(depths) > 1000
    assert np.array_equal(np.squeeze(pixels), np.round(1000.0 * depths))


def test_keys_change_the_device():
    (sensor,) = vehicle_of(device="d435", range_max_m=4.0, noise=False).sensors
    expected = dataclasses.replace(DepthCamera.d435(), range_max_m=4.0).without_noise()
    assert sensor.sensor == expected
    assert sensor.summary() == "848 × 480 px, 0.168 to 4 m"


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"device": "kinect"}, "device"),
        ({"range_min_m": 7.0}, r"sensor 'depth': range_min_m: expected less than range_max_m = 5"),
        ({"range_max_m": 70.0}, "range_max_m"),
        ({"baseline_m": 1e6}, "baseline_m: expected a smaller one"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(keys, message):
    with pytest.raises(RobotFileError, match=message):
        vehicle_of(**keys)
    with pytest.raises(OpticsError, match="range_min_m"):
        DepthCamera(range_min_m=6.0)
