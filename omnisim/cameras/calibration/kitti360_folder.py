"""KITTI-360's calibration folder: one file per fisheye camera, and the extrinsics of all cameras.

    calib_cam_to_pose.txt   per line `image_02: ` and a 3 × 4 matrix, camera to IMU
    image_02.yaml …         the fisheyes, see formats/camodocal.py

The perspective cameras of perspective.txt are not read.
Source: KITTI-360's documentation, "Calibrations".
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.calibration.calibrated_camera import CalibratedCamera, NamedPose
from omnisim.cameras.calibration.documents import read_text
from omnisim.cameras.calibration.fields import counted, parse_number, pose
from omnisim.cameras.calibration.read import read_cameras
from omnisim.core.errors import CalibrationError

EXTRINSICS = "calib_cam_to_pose.txt"
FORMAT = "kitti360"
BODY = "imu"
NUMBERS = " ".join(f"r{row}{column}" for row in "123" for column in "123t")


def read_kitti360_folder(
    folder: Path, mirrored: bool | None, theta_max_rad: float | None = None
) -> tuple[CalibratedCamera, ...]:
    """Read the fisheye cameras of a folder, at least one, with their poses relative to the IMU.

    Raises:
        CalibrationError: the folder does not exist, or a file is invalid.
    """
    path = folder / EXTRINSICS
    if not path.is_file():
        raise CalibrationError(
            f"{folder}: expected a calibration file, or KITTI-360's folder with {EXTRINSICS}, got "
            "another folder"
        )
    cameras = []
    for name, matrix in _extrinsics(path).items():
        file = folder / f"{name}.yaml"
        if file.is_file():
            read = read_cameras(file, FORMAT, mirrored, theta_max_rad)
            (camera,), poses = read.cameras, (NamedPose(BODY, name, matrix),)
            notes = (*read.notes, *camera.notes)
            cameras.append(dataclasses.replace(camera, name=name, poses=poses, notes=notes))
    if not cameras:
        raise CalibrationError(f"{folder}: expected image_02.yaml or image_03.yaml, got neither")
    return tuple(cameras)


def _extrinsics(path: Path) -> dict[str, NDArray[np.float64]]:
    """Poses (4, 4) imu_from_camera by camera name."""
    poses = {}
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        name, colon, text = line.partition(":")
        if not line.strip():
            continue
        place = f"{path}:{number}"
        if not colon:
            raise CalibrationError(f"{place}: expected image_00: and 12 numbers, got {line[:40]!r}")
        values = counted([parse_number(word, place) for word in text.split()], NUMBERS, place)
        poses[name.strip()] = pose(np.reshape(values, (3, 4)).tolist(), place)
    return poses
