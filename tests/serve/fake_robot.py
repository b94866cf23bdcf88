"""A served robot without a simulation: topics, messages as in bags, and what it is asked to do."""

import numpy as np

from omnisim.cameras import KannalaBrandtCamera
from omnisim.core.errors import ServeError
from omnisim.datasets.export.ros2 import ros_messages as ros
from omnisim.serve.publisher import Client, Topic

POSE = np.array([[0.0, -1.0, 0.0, 1.5], [1.0, 0.0, 0.0, -2.0], [0, 0, 1.0, 0.25], [0, 0, 0, 1.0]])
STAMP_NS = 12_345_678_901
LENS = KannalaBrandtCamera(64, 48, (20.0, 21.0), (31.5, 23.0), (0.1, -0.02, 0.003, -0.0004))


class FakeControls:
    """Controls that note their calls."""

    def __init__(self, *robots):
        self.robots, self.calls, self.is_paused = robots or ("robot",), [], False
        self.now_s, self.clients = 0.0, list[Client]()

    def command(self, robot, speed_mps, turn_rate_radps):
        self.calls.append(("command", robot, speed_mps, turn_rate_radps))

    def pause(self, is_paused):
        self.is_paused = is_paused
        self.calls.append(("pause", is_paused))

    def step(self, seconds, then=lambda now_s: None):
        if not (self.is_paused and seconds < 3600.0):
            raise ServeError("step: expected paused time")
        self.calls.append(("step", seconds))
        then(seconds)

    def reset(self):
        self.calls.append(("reset",))

    def set_pose(self, robot, x_m, y_m, yaw_rad):
        self.calls.append(("set_pose", robot, x_m, y_m, yaw_rad))


def cloud_points():
    """Points (3,) of a lidar with all kinds of fields."""
    columns = [
        ("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4"), ("ring", "u2"), ("time", "f8"),
    ]  # fmt: skip
    return ros.point_fields(
        (name, np.arange(3).astype(kind) + i) for i, (name, kind) in enumerate(columns)
    )


def messages(stamp_ns=STAMP_NS):
    """Messages by topic."""
    pixels = np.arange(48 * 64 * 3, dtype=np.uint32).reshape(48, 64, 3).astype(np.uint8)
    ranges_m = np.array([1.0, 2.0, np.inf])
    return {
        "/front/image_raw": ros.image(stamp_ns, "front_optical_frame", pixels),
        "/front/instance": ros.image(stamp_ns, "front", pixels[..., 0].astype(np.uint32)),
        "/front/image_raw/compressed": ros.compressed_image(stamp_ns, "front", b"\x89PNG..."),
        "/front/camera_info": ros.camera_info_message(stamp_ns, "front", LENS),
        "/front/calibration": ros.text('{"model": "kannala_brandt"}'),
        "/lidar/points": ros.point_cloud(stamp_ns, "lidar", cloud_points()),
        "/laser/scan": ros.laser_scan(
            stamp_ns, "laser", np.array([-0.5, 0.0, 0.5]), ranges_m, (0.1, 20.0)
        ),
        "/imu/data_raw": ros.imu(stamp_ns, "imu", (0.1, 0.2, 0.3), (0.0, 0.5, 9.81)),
        "/sonar/range": ros.range_message(stamp_ns, "sonar", 0.4, (0.1, 4.0), 1.25),
        "/odom": ros.odometry(stamp_ns, ("odom", "base_link"), POSE, (1, 0, 0), (0, 0, 0.5)),
        "/ground_truth/pose": ros.pose_stamped(stamp_ns, "map", POSE),
        "/tf": ros.transforms(stamp_ns, {("map", "odom"): np.eye(4), ("odom", "base_link"): POSE}),
        "/tf_static": ros.transforms(stamp_ns, {("base_link", "imu"): POSE}),
        "/map": occupancy_grid(stamp_ns),
        "/robot_description": ros.text("<robot name='r'/>"),
    }


LATCHED = ("/tf_static", "/map", "/robot_description", "/front/calibration")


def occupancy_grid(stamp_ns):
    """Map of 3 × 2 cells of 0.5 m: unknown, free and occupied."""
    from rosbags.typesys.stores import ros2_humble as types

    header = ros.header(stamp_ns, "map")
    pose = ros.pose_stamped(stamp_ns, "map", POSE).pose
    info = types.nav_msgs__msg__MapMetaData(header.stamp, 0.5, 3, 2, pose)
    data = np.array([-1, 0, 100, 50, 0, -1], dtype=np.int8)
    return types.nav_msgs__msg__OccupancyGrid(header, info, data)


def topics():
    """Topics of the messages, and the clock."""
    clock = Topic("/clock", "rosgraph_msgs/msg/Clock")
    return [
        clock,
        *(
            Topic(name, message.__msgtype__, is_latched=name in LATCHED)
            for name, message in messages().items()
        ),
    ]
