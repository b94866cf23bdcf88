"""A small run with every sensor, and its points as exports shall show them."""

from types import SimpleNamespace

import numpy as np
import pytest

from omnisim.datasets.export.recording import Recording
from omnisim.robots import parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene
from tests.scenes import room, scene_of

LENSES = {
    "pinhole.toml": '[lens]\nmodel = "perspective"\nwidth_px = 64\nheight_px = 48\n'
    "focal_length_px = 40.0\nprincipal_point_px = [31.5, 23.5]\n",
    "fisheye.toml": '[lens]\nmodel = "kannala_brandt"\nwidth_px = 48\nheight_px = 48\n'
    "focal_lengths_px = [17.0, 17.1]\nprincipal_point_px = [23.4, 23.6]\n"
    "coefficients = [0.01, -0.002, 0.0005, 0.0]\ntheta_max_deg = 80.0\n",
}
SENSORS = [
    {"name": "front", "type": "omnicamera", "file": "pinhole.toml", "position_m": [0.3, 0.0, 0.5]},
    {"name": "fisheye", "type": "omnicamera", "file": "fisheye.toml",
     "position_m": [0.2, 0.1, 0.6], "yaw_deg": 20.0},
    {"name": "mirror", "type": "omnicamera", "file": "mirror.toml", "position_m": [0.0, 0.0, 0.7]},
    {"name": "imu", "type": "imu", "position_m": [0.1, 0.0, 0.2], "yaw_deg": 90.0, "rate_hz": 20.0},
    {"name": "kinect", "type": "depth_camera", "position_m": [0.25, 0.0, 0.4],
     "width_px": 32, "height_px": 24, "focal_length_px": 29.0},
    {"name": "laser", "type": "lms200", "position_m": [0.2, 0.0, 0.3], "resolution_deg": 1.0},
    {"name": "lidar", "type": "lidar", "position_m": [0.0, 0.0, 0.9], "firings": 36},
    {"name": "sonar", "type": "usarsim_sonar", "position_m": [0.3, 0.0, 0.2]},
]  # fmt: skip
START_M, SPEED_MPS, LIDAR_HEIGHT_M = -1.0, 4.0, 0.3
FAST_SENSORS = [
    {"name": "lidar", "type": "lidar", "position_m": [0.0, 0.0, LIDAR_HEIGHT_M], "rate_hz": 10.0,
     "firings": 90, "noise": False, "step_m": 0.0, "range_min_m": 0.0},
    {"name": "fisheye", "type": "omnicamera", "file": "fisheye.toml",
     "position_m": [0.0, 0.0, 0.4], "rate_hz": 2.0},
]  # fmt: skip


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """Run of a drive with every sensor, four steps, with ranges, labels and flow."""
    folder = tmp_path_factory.mktemp("cart")
    for name, text in LENSES.items():
        (folder / name).write_text(text)
    (folder / "mirror.toml").write_text("[camera]\nwidth_px = 48\nheight_px = 48\n")
    path = folder / "path.csv"
    path.write_text("t_s,x_m,y_m,yaw_deg\n0,0,0,0\n0.5,0.2,0,5\n1,0.4,0.05,10\n1.5,0.6,0.1,15\n")
    robot = parse_robot({"name": "cart", "sensors": SENSORS}, "robot", folder)
    vehicle = Vehicle.from_robot(robot).with_cameras(quality="fast")
    drive = Drive(
        load_scene("soccer"),
        vehicle,
        Route(str(path)),
        channels=("range", "semantic", "instance", "flow", "occluded"),
    )
    list(drive.plan().record(folder / "run"))
    return folder / "run"


@pytest.fixture(scope="session")
def fast_run(tmp_path_factory):
    """Run of half a second in a box, with a lidar of 10 Hz and a fisheye of 2 Hz."""
    folder = tmp_path_factory.mktemp("fast")
    (folder / "fisheye.toml").write_text(LENSES["fisheye.toml"])
    stop_m = START_M + 0.5 * SPEED_MPS
    (folder / "path.csv").write_text(f"t_s,x_m,y_m,yaw_deg\n0,{START_M},0,0\n0.5,{stop_m},0,0\n")
    vehicle = Vehicle.from_robot(
        parse_robot({"name": "cart", "sensors": FAST_SENSORS}, "robot", folder)
    )
    drive = Drive(scene_of([room()]), vehicle, Route(str(folder / "path.csv")))
    list(drive.plan().record(folder / "run"))
    return folder / "run"


@pytest.fixture(scope="session")
def seen(run):
    """Points of the world that a camera sees at a step, and its image's colors there."""

    def points(camera, step):
        recording = Recording.read(run, camera)
        (recorded,) = recording.cameras
        points_m, hit = recorded.points_m(recorded.channel(step, "range"))
        pose = recording.truth.world_from_base[step] @ recorded.mount.base_from_optical
        world_m = points_m @ pose[:3, :3].T + pose[:3, 3]
        v, u = np.nonzero(hit)
        return SimpleNamespace(
            world_m=world_m,
            colors=recorded.image(step)[hit],
            pixels=np.stack((u, v), axis=-1),
            width_px=recorded.size_px[0],
        )

    return points


@pytest.fixture(scope="session")
def check_pixels(seen):
    """Checks that projected points of the world land on the pixels that have their colors."""

    def check(pixels, image, camera, step, within_px=1e-3, shown=slice(None)):
        expected = seen(camera, step)
        u, v = expected.pixels[shown].T
        u = expected.width_px - 1 - u if camera == "mirror" else u
        np.testing.assert_allclose(pixels, np.stack((u, v), axis=-1), atol=within_px)
        at = np.round(pixels).astype(int)
        np.testing.assert_array_equal(image[at[:, 1], at[:, 0], :3], expected.colors[shown])

    return check
