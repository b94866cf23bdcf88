"""ORB-SLAM3: one or two cameras, with or without an IMU.

Source: Campos et al., "ORB-SLAM3: an accurate open-source library for visual, visual-inertial and
multi-map SLAM", T-RO 2021; package `pyorbslam3`. Its license is the GPL. It runs in its own
process, see `orb_slam3_program`.
"""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

from omnisim.cameras import KannalaBrandtCamera
from omnisim.cameras.calibration.calibrated_camera import NamedPose
from omnisim.cameras.calibration.documents import parse_yaml
from omnisim.cameras.calibration.formats import orbslam3
from omnisim.cameras.calibration.formats.format import ParsedCamera, yaml_float
from omnisim.cameras.calibration.formats.opencv import OpencvFisheye
from omnisim.core.arrays import Bools, Bytes, Floats, Indices
from omnisim.core.errors import EstimatorError
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import CameraTracker
from omnisim.evaluation.estimators import orb_slam3_program as program
from omnisim.sensors.imu.imu import Imu

# ORB descriptors of rendered images, for place recognition; `.ci/train_orb_vocabulary.py` makes it.
VOCABULARY = Path(__file__).with_name("orb_vocabulary.txt.gz")
MAX_OFFSET_S = 1e-3  # between the two images of a pair
MAX_MISFIT_PX = 0.5  # error of the second lens with the first one's coefficients
_TAIL = 300  # characters of the process's output in a message
# EuRoC's names of the noise densities in a run's IMU parameters, by ORB-SLAM3's names.
NOISE = {
    "NoiseGyro": "gyroscope_noise_density", "NoiseAcc": "accelerometer_noise_density",
    "GyroWalk": "gyroscope_random_walk", "AccWalk": "accelerometer_random_walk",
}  # fmt: skip


class _SettingsLens(OpencvFisheye):
    """Lens of ORB-SLAM3's settings, which have no skew."""

    fisheye_skew = False


class OrbSlam3(CameraTracker):
    """Feature-based SLAM with the first camera."""

    title = "ORB-SLAM3 (one camera)"
    package, module, extra = "pyorbslam3", "pyorbslam3", "orb-slam3"
    is_repeatable = False
    cameras = 1
    has_imu = False

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the tracked frame at the tracked images of the largest map."""
        if not run.cameras:
            raise EstimatorError("the run has no camera")
        if len(run.cameras) < self.cameras:
            raise EstimatorError("the run has one camera: expected two")
        if self.has_imu and not run.sensors(Imu):
            raise EstimatorError("the run has no IMU")
        run = run.in_frames([camera.name for camera in run.cameras[: self.cameras]], _refuse_late)
        cameras = [LensCamera.of(camera, _ignore) for camera in run.cameras[: self.cameras]]
        times_s = run.times_s(cameras[0].name)
        if len(times_s) < 3:
            raise EstimatorError(f"{len(times_s)} images: expected at least 3")
        lenses = [camera.encode(_SettingsLens(), _ignore) for camera in cameras]
        _check_pair(lenses)
        fps = 1.0 / float(np.median(np.diff(times_s)))
        base_from_body = cameras[0].base_from_lens
        imu, second = None, None
        if self.has_imu:
            name = run.sensors(Imu)[0]
            parameters = parse_yaml(run.imu_parameters(name), name)
            noise = {key: float(parameters[own]) for key, own in NOISE.items()}
            imu_from_camera = inverse(run.base_from_imu(name)) @ base_from_body
            imu = ImuSettings(imu_from_camera, float(parameters["rate_hz"]), noise)
            base_from_body = run.base_from_imu(name)
            readings = run.imu_readings(name)
            np.save(work / program.IMU, np.column_stack((readings.times_s, readings.values)))
        if self.cameras == 2:
            second = inverse(cameras[0].base_from_lens) @ cameras[1].base_from_lens
        (work / program.SETTINGS).write_text(settings_text(lenses, fps, second, imu))
        np.save(work / program.TIMES, times_s)
        request = {
            "vocabulary": str(unpacked_vocabulary(work)), "width_px": lenses[0].width_px,
            "height_px": lenses[0].height_px, "cameras": self.cameras, "fps": fps,
        }  # fmt: skip
        (work / program.REQUEST).write_text(json.dumps(request))
        _run_program(work, _frames(run, cameras))
        return _trajectory(work, times_s, self.tracked_from_base(run) @ base_from_body)


class OrbSlam3Stereo(OrbSlam3):
    """Feature-based SLAM with the first two cameras."""

    title = "ORB-SLAM3 (stereo)"
    alignment = "se3"
    cameras = 2


class OrbSlam3Inertial(OrbSlam3):
    """Feature-based SLAM with the first camera and the first IMU."""

    title = "ORB-SLAM3 (one camera, IMU)"
    alignment = "se3"
    is_level = True
    has_imu = True


class OrbSlam3StereoInertial(OrbSlam3Stereo):
    """Feature-based SLAM with the first two cameras and the first IMU."""

    title = "ORB-SLAM3 (stereo, IMU)"
    is_level = True
    has_imu = True


def _ignore(note: str) -> None:
    pass


def _refuse_late(note: str) -> None:
    raise EstimatorError(f"expected images of both cameras at the same times: {note}")


def _check_pair(lenses: list[KannalaBrandtCamera]) -> None:
    """Reject a second lens that differs from the first one in size, or by `MAX_MISFIT_PX`."""
    first, second = lenses[0], lenses[-1]
    if (first.width_px, first.height_px) != (second.width_px, second.height_px):
        raise EstimatorError("expected two cameras of the same image size")
    theta = np.linspace(0.0, 0.5 * np.pi, 50)
    powers = np.stack([theta**degree for degree in (3, 5, 7, 9)])
    misfit = np.subtract(first.coefficients, second.coefficients) @ powers
    misfit_px = max(second.focal_lengths_px) * float(np.abs(misfit).max())
    if misfit_px > MAX_MISFIT_PX:
        raise EstimatorError(
            "ORB-SLAM3 uses the first lens's coefficients for both lenses: "
            f"the second lens's error would be {misfit_px:.3g} px"
        )


def _frames(run: Recording, cameras: list[LensCamera]) -> Iterator[bytes]:
    """Bytes of the cameras' gray images, frame by frame, without the edge of the image circle.

    Pixels without a ray, or more than 90° from the axis, take the value of the nearest other pixel.
    Otherwise corners on the rim of the image circle would move with the camera.
    """
    nearest = [_nearest_shown(camera.mask(front_only=True)) for camera in cameras]
    for step in range(run.steps):
        for camera, source in zip(cameras, nearest, strict=True):
            image = camera.flip(camera.recorded.image(step))
            levels = gray(image)
            yield (levels if source is None else levels[source]).tobytes()


def _nearest_shown(mask: Bools | None) -> tuple[Indices, ...] | None:
    """Rows and columns (height, width) of the nearest pixels in a mask; None: no mask."""
    if mask is None:
        return None
    return tuple(
        scipy.ndimage.distance_transform_edt(~mask, return_distances=False, return_indices=True)
    )


def unpacked_vocabulary(folder: Path) -> Path:
    """Unpack the built-in vocabulary into a folder; returns the file's path."""
    path = folder / VOCABULARY.stem
    path.write_bytes(gzip.decompress(VOCABULARY.read_bytes()))
    return path


def _run_program(work: Path, frames: Iterator[bytes]) -> None:
    """Run ORB-SLAM3 in its own process."""
    log = work / "output.txt"
    with log.open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, program.__file__, str(work)],
            stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT, cwd=work,
        )  # fmt: skip
        assert process.stdin is not None
        try:
            with suppress(BrokenPipeError):  # the exit status tells the reason
                for frame in frames:
                    process.stdin.write(frame)
        except BaseException:
            process.kill()
            raise
        finally:
            with suppress(BrokenPipeError):
                process.stdin.close()
            status = process.wait()
    if status:
        message = log.read_text(encoding="utf-8", errors="replace").strip()[-_TAIL:]
        raise EstimatorError(f"ORB-SLAM3: exit status {status}: {message or 'without a message'}")


def _trajectory(work: Path, times_s: Floats, tracked_from_body: Floats) -> Trajectory:
    """Trajectory of the tracked frame from the files of frame and keyframe poses.

    Frame poses are in the frame of the first keyframe, keyframe poses in the world.
    """
    frames, keyframes = (_poses(work / name) for name in (program.FRAMES, program.KEYFRAMES))
    if not len(frames[0]) or not len(keyframes[0]):
        raise EstimatorError("ORB-SLAM3 tracked no image")
    world_from_first = keyframes[1][0]
    steps = np.abs(times_s[:, None] - frames[0]).argmin(axis=0)
    poses = world_from_first @ frames[1] @ inverse(tracked_from_body)
    return Trajectory(times_s[steps], poses)


def _poses(path: Path) -> tuple[Floats, Floats]:
    """Times (n,), s, and poses (n, 4, 4) of a file in EuRoC's format; empty if it is missing."""
    if not path.is_file() or not path.stat().st_size:
        return np.empty(0), np.empty((0, 4, 4))
    table = np.loadtxt(path, ndmin=2)  # stamp in ns, position, quaternion x y z w
    rotations = scipy.spatial.transform.Rotation.from_quat(table[:, 4:]).as_matrix()
    return table[:, 0] * 1e-9, pose_from_rotation(rotations, table[:, 1:4])


# Settings file of ORB-SLAM3, from the calibration of a run.
#
# ORB-SLAM3 uses the second camera's focal lengths and principal point with the first camera's
# coefficients.
#
# Sources: ORB-SLAM3's calibration tutorial, and `Settings.cc`.


# Minimum noise of the IMU: without noise, information matrices are singular.
MIN_NOISE = {"NoiseGyro": 1e-5, "NoiseAcc": 1e-4, "GyroWalk": 1e-7, "AccWalk": 1e-6}
# Required keys of the viewer, which is not opened.
VIEWER = (
    *("KeyFrameSize", "KeyFrameLineWidth", "GraphLineWidth", "PointSize", "CameraSize"),
    *("CameraLineWidth", "ViewpointX", "ViewpointY", "ViewpointZ", "ViewpointF"),
)


@dataclass(frozen=True, eq=False)
class ImuSettings:
    """IMU parameters of a settings file."""

    imu_from_camera: Floats  # (4, 4) pose of the first camera
    rate_hz: float  # readings per second
    # densities of noise and random walk by their keys in the settings file, SI units
    noise: dict[str, float]


def settings_text(
    lenses: Sequence[KannalaBrandtCamera],
    fps: float,
    first_from_second: Floats | None = None,
    imu: ImuSettings | None = None,
) -> str:
    """Text of a settings file for one or two lenses of the same size, with an IMU or without.

    `first_from_second` is the (4, 4) pose of the second camera.
    """
    poses = []
    if first_from_second is not None:
        poses.append(NamedPose(*orbslam3.NAMES, first_from_second))
    if imu is not None:
        poses.append(NamedPose("imu", orbslam3.NAMES[0], imu.imu_from_camera))
    cameras = [
        ParsedCamera(name, lens, tuple(poses))
        for name, lens in zip(orbslam3.NAMES, lenses, strict=False)
    ]
    text = orbslam3.OrbSlam3().encode(cameras).replace("fps: 30", f"fps: {max(1, round(fps))}")
    if imu is not None:
        for key, least in MIN_NOISE.items():
            text += f"IMU.{key}: {yaml_float(max(imu.noise[key], least))}\n"
        text += f"IMU.Frequency: {yaml_float(imu.rate_hz)}\n"
    return text + "".join(f"Viewer.{key}: 1.0\n" for key in VIEWER)


# Gray images for estimators.


LUMA = np.array((0.299, 0.587, 0.114), dtype=np.float32)  # ITU-R BT.601, as in OpenCV


def gray(image: Bytes) -> Bytes:
    """Gray image (height, width) of an sRGB image (height, width, 3)."""
    return np.rint(image.astype(np.float32) @ LUMA).astype(np.uint8)
