"""Drive a served robot round the field's lap by what it sees, from another process.

    omnisim drive soccer --robot p2at --path lap --also instance -o learned
    omnisim landmarks train learned -o colors.npz
    omnisim serve p2at --scene soccer --protocols plain --fast
    python examples/serve_controller.py colors.npz

The controller has the stream alone: images, odometry and the camera's calibration, and a map of
the landmarks. It localizes with the filter of the paper, and follows the waypoints of the lap. With
`--ros2` it is a ROS 2 node, by zenoh-ros2-sdk, of a robot served with `--protocols ros2`.
"""

import argparse
import json
import math
import queue
import threading
from dataclasses import asdict
from functools import partial

import numpy as np

import omnisim
from omnisim import serve
from omnisim.core.poses import wrap_angle
from omnisim.perception.landmarks.color_model import load_model
from omnisim.perception.landmarks.landmark_detector import LandmarkDetector
from omnisim.perception.localization.filter import (
    LandmarkMap,
    LocalizationFilter,
    read_parameters,
)
from omnisim.perception.localization.track import observation_from_detection
from omnisim.sensors.calibration_file import parse_mount

IMAGE, ODOMETRY, CALIBRATION = "/omnicam/image_raw", "/odom", "/omnicam/calibration"
TOPICS = {
    IMAGE: "sensor_msgs/msg/Image",
    ODOMETRY: "nav_msgs/msg/Odometry",
    CALIBRATION: "std_msgs/msg/String",
}
SPEED_MPS, NEAR_M, TURN_GAIN, TURN_FIRST_RAD = 0.3, 0.05, 2.0, 0.25


class Driver:
    """Localizes by images and odometry, and says how to drive along waypoints (n, 2)."""

    def __init__(self, model, calibration, start, waypoints_m):
        colors, landmarks = load_model(model)
        mount = parse_mount(json.loads(calibration), CALIBRATION)
        self._detector = LandmarkDetector(colors, landmarks, mount)
        self._noise = read_parameters(None)
        here = LandmarkMap.of_scene(landmarks)
        self._filter = LocalizationFilter(here, self._noise, mount.position_m, 0.0, start)
        self._waypoints_m = [np.array(point) for point in waypoints_m]
        self._begin_m = np.array(start[:2])
        self._odometry = None

    def see(self, image, odometry):
        """Estimate (x, y, yaw) from an image and the odometry at its time."""
        if self._odometry is not None:
            seconds = odometry.stamp_s - self._odometry.stamp_s
            distance_m, turn_rad = _between(self._odometry, odometry)
            seen = [
                observation_from_detection(each, self._noise.measurement)
                for each in self._detector(image.image)
            ]
            self._filter.step(odometry.stamp_s, distance_m / seconds, turn_rad, seen)
        self._odometry = odometry
        return self._filter.estimate.pose

    def steer(self, pose):
        """Speed and turn rate toward the line to the next waypoint; None: the lap is done."""
        x, y, yaw = pose
        while self._waypoints_m:
            goal = self._waypoints_m[0]
            leg = goal - self._begin_m
            length = float(np.hypot(*leg))
            ahead = length - float(leg @ ((x, y) - self._begin_m)) / max(length, 1e-9)
            if length > NEAR_M and ahead > NEAR_M:
                break
            self._begin_m = self._waypoints_m.pop(0)
        else:
            return None
        off_m = (x, y) - self._begin_m
        left_m = float(leg[0] * off_m[1] - leg[1] * off_m[0]) / length
        off = wrap_angle(math.atan2(leg[1], leg[0]) - math.atan(2.0 * left_m) - yaw)
        if abs(off) > TURN_FIRST_RAD:
            return 0.0, math.copysign(min(TURN_GAIN * abs(off), 0.8), off)
        return min(SPEED_MPS, 0.1 + ahead), TURN_GAIN * off


def _between(before, after):
    """Distance and turn between two odometry messages, along an arc."""
    (x0, y0, yaw0), (x1, y1, yaw1) = map(_planar, (before, after))
    turn = wrap_angle(yaw1 - yaw0)
    along = yaw0 + 0.5 * turn
    chord = (x1 - x0) * math.cos(along) + (y1 - y0) * math.sin(along)
    return chord / float(np.sinc(turn / (2.0 * math.pi))), turn


def _planar(odometry):
    pose = odometry.fields["pose"]["pose"]
    position, turned = pose["position"], pose["orientation"]
    return position["x"], position["y"], 2.0 * math.atan2(turned["z"], turned["w"])


class RosNode:
    """Connection as a ROS 2 node, with the methods of the client of `serve.connect`."""

    def __init__(self, port):
        import zenoh_ros2_sdk as sdk

        self._session = sdk.ZenohSession.get_instance(router_port=port)
        self._messages, self._news = queue.SimpleQueue(), threading.Condition()
        self._stepped_ns, self._stamps_ns = 0, {IMAGE: -1, ODOMETRY: -1}
        for topic, kind in TOPICS.items():
            receive = partial(self._receive, topic, kind)
            key = sdk.ROS2Subscriber(topic, kind, receive).keyexpr
            # What was published before; the SDK asks for it only if a name has no second slash.
            for reply in self._session.session.get(f"{key}/@adv/pub/*/**?_anyke"):
                receive(self._session.store.deserialize_cdr(reply.ok.payload.to_bytes(), kind))
        self._twist = sdk.ROS2Publisher("/cmd_vel", "geometry_msgs/msg/Twist")
        nothing, answer = (
            "uint8 structure_needs_at_least_one_member",
            "bool success\nstring message",
        )
        self._trigger = sdk.ROS2ServiceClient("/step", "std_srvs/srv/Trigger", nothing, answer)

    def __enter__(self):
        return self

    def __exit__(self, *reason):
        self._session.close()

    def _receive(self, topic, kind, message):
        stamp_ns = 0
        if topic != CALIBRATION:
            stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        self._messages.put(serve.ServedMessage(topic, kind, stamp_ns, asdict(message)))
        with self._news:
            self._stamps_ns[topic] = stamp_ns
            self._news.notify()

    def next(self, timeout_s):
        """Oldest message that is not read yet; None: none within a time."""
        try:
            return self._messages.get(timeout_s is None or timeout_s > 0.0, timeout_s)
        except queue.Empty:
            return None

    def command(self, speed_mps, turn_rate_radps):
        """Drive at a speed and turn rate."""
        vector = partial(self._session.store.types["geometry_msgs/msg/Vector3"], y=0.0)
        linear, angular = vector(x=speed_mps, z=0.0), vector(x=0.0, z=turn_rate_radps)
        self._twist.publish(linear=linear, angular=angular)

    def step(self, seconds):
        """Advance a lockstepped simulation, in calls of 0.1 s, until its messages are there."""
        for _ in range(round(seconds / 0.1)):
            answer = self._trigger.call(structure_needs_at_least_one_member=0)
            if answer is None or not answer.success:
                raise SystemExit("/step: no answer" if answer is None else answer.message)
        self._stepped_ns += round(seconds * 1e9)
        with self._news:
            for topic in (IMAGE, ODOMETRY):
                self._news.wait_for(lambda at=topic: self._stamps_ns[at] >= self._stepped_ns, 5.0)


def main():
    """Follow the lap once; print where the robot believes to be."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", help="colors of the landmarks, from omnisim landmarks train")
    parser.add_argument("--address", default="ws://localhost:8765")
    parser.add_argument(
        "--ros2", metavar="PORT", type=int, nargs="?", const=7447, help="router to join as a node"
    )
    parser.add_argument("--scene", default="soccer")
    parser.add_argument("--step", type=float, help="seconds between images of a --lockstep server")
    options = parser.parse_args()
    scene = omnisim.load_scene(options.scene)
    start = scene.starts[0]
    (lap,) = (path.waypoints_m for path in scene.paths if path.name == start.name)
    driver, odometry, images = None, {}, {}
    connection = (
        RosNode(options.ros2) if options.ros2 else serve.connect(options.address, list(TOPICS))
    )
    with connection as robot:
        while True:
            message = robot.next(0.0 if options.step else None)
            if message is None and options.step:
                robot.step(options.step)
                continue
            if message is None:
                return
            if message.topic == CALIBRATION:
                begin = (*start.position_m[:2], math.radians(start.yaw_deg))
                text = message.fields["data"]
                driver = Driver(options.model, text, begin, lap[1:5])
            elif message.topic == ODOMETRY:
                odometry = {message.stamp_ns: message}
            else:
                images = {message.stamp_ns: message}
            if driver is not None and (both := odometry.keys() & images.keys()):
                stamp_ns = both.pop()
                pose = driver.see(images.pop(stamp_ns), odometry[stamp_ns])
                command = driver.steer(pose)
                if command is None:
                    robot.command(0.0, 0.0)
                    print(f"the lap took {message.stamp_s:.1f} s")
                    return
                robot.command(*command)
                print(f"{message.stamp_s:6.1f} s  {pose[0]:6.2f} {pose[1]:6.2f} m", flush=True)


if __name__ == "__main__":
    main()
