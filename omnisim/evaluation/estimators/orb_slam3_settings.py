"""Settings file of ORB-SLAM3, from the calibration of a run.

ORB-SLAM3 uses the second camera's focal lengths and principal point with the first camera's
coefficients.

Sources: ORB-SLAM3's calibration tutorial, and `Settings.cc`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import KannalaBrandtCamera

FEATURES = 1000  # per image
# Minimum noise of the IMU: without noise, information matrices are singular.
MIN_NOISE = {"NoiseGyro": 1e-5, "NoiseAcc": 1e-4, "GyroWalk": 1e-7, "AccWalk": 1e-6}
# Required keys of the viewer, which is not opened.
VIEWER = (
    *("KeyFrameSize", "KeyFrameLineWidth", "GraphLineWidth", "PointSize", "CameraSize"),
    *("CameraLineWidth", "ViewpointX", "ViewpointY", "ViewpointZ", "ViewpointF"),
)
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ImuSettings:
    """IMU parameters of a settings file.

    Attributes:
        imu_from_camera: (4, 4) pose of the first camera in the IMU's frame.
        rate_hz: readings per second.
        noise: densities of noise and random walk of gyroscope and accelerometer, by their keys in
            the settings file, in SI units.
    """

    imu_from_camera: Floats
    rate_hz: float
    noise: dict[str, float]


def settings_text(
    lenses: Sequence[KannalaBrandtCamera],
    fps: float,
    first_from_second: Floats | None = None,
    imu: ImuSettings | None = None,
) -> str:
    """Text of a settings file.

    Args:
        lenses: one or two lenses of the same size.
        fps: images per second.
        first_from_second: (4, 4) pose of the second camera in the first one's frame; None: one
            camera.
        imu: IMU parameters; None: no IMU.
    """
    first = lenses[0]
    lines = ["%YAML:1.0", "---", 'File.version: "1.0"', 'Camera.type: "KannalaBrandt8"']
    for number, lens in enumerate(lenses, start=1):
        values = *lens.focal_lengths_px, *lens.principal_point_px
        intrinsics = zip(("fx", "fy", "cx", "cy"), values, strict=True)
        lines += [f"Camera{number}.{key}: {_real(value)}" for key, value in intrinsics]
        lines += [
            f"Camera{number}.k{index}: {_real(value)}"
            for index, value in enumerate(lens.coefficients, start=1)
        ]
        lines += [f"Camera{number}.overlappingBegin: 0"]
        lines += [f"Camera{number}.overlappingEnd: {first.width_px - 1}"]
    lines += [f"Camera.width: {first.width_px}", f"Camera.height: {first.height_px}"]
    lines += [f"Camera.fps: {max(1, round(fps))}", "Camera.RGB: 1"]
    if first_from_second is not None:
        lines += [*_matrix("Stereo.T_c1_c2", first_from_second), "Stereo.ThDepth: 40.0"]
    if imu is not None:
        lines += _matrix("IMU.T_b_c1", imu.imu_from_camera)
        for key, least in MIN_NOISE.items():
            lines.append(f"IMU.{key}: {_real(max(imu.noise[key], least))}")
        lines += [f"IMU.Frequency: {_real(imu.rate_hz)}"]
    lines += [f"ORBextractor.nFeatures: {FEATURES}", "ORBextractor.scaleFactor: 1.2"]
    lines += ["ORBextractor.nLevels: 8", "ORBextractor.iniThFAST: 20", "ORBextractor.minThFAST: 7"]
    lines += [f"Viewer.{key}: 1.0" for key in VIEWER]
    return "\n".join(lines) + "\n"


def _matrix(key: str, pose: Floats) -> list[str]:
    numbers = ", ".join(_real(value) for value in pose.ravel())
    return [f"{key}: !!opencv-matrix", "  rows: 4", "  cols: 4", "  dt: f", f"  data: [{numbers}]"]


def _real(value: float) -> str:
    """Number with a decimal point, since ORB-SLAM3 refuses integers."""
    return f"{float(value):.17g}" if "." in f"{float(value):.17g}" else f"{float(value):.1f}"
