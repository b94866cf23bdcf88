"""Drive a served robot round the field's lap by what it sees, from another process.

    omnisim drive soccer --robot p2at --path lap --also instance -o learned
    omnisim landmarks train learned -o colors.npz
    omnisim serve p2at --scene soccer --protocols plain --fast
    python examples/serve_controller.py colors.npz

The controller has the stream alone: images, odometry and the camera's calibration, and a map of
the landmarks. It localizes with the filter of the paper, and follows the waypoints of the lap.
"""

import argparse
import json
import math

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

IMAGE, CALIBRATION = "/omnicam/image_raw", "/omnicam/calibration"
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


def main():
    """Follow the lap once; print where the robot believes to be."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", help="colors of the landmarks, from omnisim landmarks train")
    parser.add_argument("--address", default="ws://localhost:8765")
    parser.add_argument("--scene", default="soccer")
    parser.add_argument("--step", type=float, help="seconds between images of a --lockstep server")
    options = parser.parse_args()
    scene = omnisim.load_scene(options.scene)
    start = scene.starts[0]
    (lap,) = (path.waypoints_m for path in scene.paths if path.name == start.name)
    topics = [IMAGE, CALIBRATION, "/odom"]
    driver, odometry, images = None, {}, {}
    with serve.connect(options.address, topics) as robot:
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
            elif message.topic == "/odom":
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
