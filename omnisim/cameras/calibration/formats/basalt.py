"""Basalt's calibration JSON.

| camera_type | intrinsics | model |
| --- | --- | --- |
| pinhole | fx fy cx cy | perspective, unified with ξ = 0 |
| ucm | fx fy cx cy alpha | EUCM with β = 1 |
| eucm | … alpha beta | eucm |
| ds | … xi alpha | double_sphere |
| kb4 | … k1 k2 k3 k4 | kannala_brandt |
| pinhole-radtan8 | … k1 k2 p1 p2 k3 k4 k5 k6 rpmax | rational_polynomial, θ_max = atan rpmax |

`T_imu_cam` maps the camera frame to the IMU frame; a camera timestamp plus `cam_time_offset_ns` is
IMU time. If the pose is unknown, the first camera stands
in for the IMU, and an omnisim key in the file says so. Pixel (0, 0) is the center of the first
pixel, as in omnisim.

Source: basalt-headers, calibration and camera models; Usenko et al. 2018; Monado, which adds
`pinhole-radtan8`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    DoubleSphereCamera,
    EucmCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose, find_pose
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.errors import CalibrationError
from omnisim.core.files.parameters import Number

FOCAL = "fx fy cx cy"
INTRINSICS = {
    "pinhole": FOCAL, "ucm": f"{FOCAL} alpha", "eucm": f"{FOCAL} alpha beta",
    "ds": f"{FOCAL} xi alpha", "kb4": f"{FOCAL} k1 k2 k3 k4",
    "pinhole-radtan8": f"{FOCAL} k1 k2 p1 p2 k3 k4 k5 k6 rpmax",
}  # fmt: skip
POSES_UNKNOWN = "omnisim_poses_not_known"
BasaltLens = (
    DoubleSphereCamera | KannalaBrandtCamera | EucmCamera | UnifiedCamera | RationalPolynomialCamera
)


class _Intrinsics(ForeignTable):
    camera_type: str
    intrinsics: dict[str, Number]


class _Pose(ForeignTable):
    px: Number
    py: Number
    pz: Number
    qx: Number
    qy: Number
    qz: Number
    qw: Number


class _Value(
    ForeignTable,
    inner={"T_imu_cam": _Pose, "intrinsics": _Intrinsics},
    unread={
        "vignette": Unread("fall-off of brightness: [degradation.vignetting] of a sensor file"),
        "view_offset": Unread("offset between the cameras' images"),
    },
    harmless=(
        "calib_accel_bias calib_gyro_bias imu_update_rate accel_noise_std gyro_noise_std "
        "accel_bias_std gyro_bias_std mocap_time_offset_ns mocap_to_imu_offset_ns T_mocap_world "
        "T_imu_marker"
    ),
):
    T_imu_cam: tuple[dict[str, Any], ...] = ()
    intrinsics: list[dict[str, Any]]
    resolution: list[list[documents.Size]]
    cam_time_offset_ns: Number = 0.0


class _File(ForeignTable, inner={"value0": _Value}, also_read=POSES_UNKNOWN):
    """Content of a file."""


class Basalt(Format[BasaltLens]):
    """Format of Basalt's calibration tool."""

    name = "basalt"
    title = "Basalt: calibration json"
    suffix = ".json"
    models = (
        DoubleSphereCamera, KannalaBrandtCamera, EucmCamera, UnifiedCamera,
        RationalPolynomialCamera,
    )  # fmt: skip
    fits = ((DoubleSphereCamera, ANY), (KannalaBrandtCamera, ANY), (EucmCamera, ANY))
    signature = re.compile(r'"value0"\s*:(?!\s*\{\s*"config\.)')
    metadata_place = base.MetadataPlace.KEY
    several = True
    tables = (_File,)

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras in `value0`."""
        place = f"{source}: value0"
        value = parse(document.get("value0"), _Value, place)
        if not value.intrinsics or len(value.resolution) != len(value.intrinsics):
            counts = f"{len(value.intrinsics)} and {len(value.resolution)}"
            raise unexpected(place, "intrinsics and a resolution for every camera", counts)
        cameras = []
        for index, (part, size) in enumerate(zip(value.intrinsics, value.resolution, strict=True)):
            name = f"cam{index}"
            lens = _lens(part, size, f"{place}.intrinsics.{index}")
            poses: tuple[NamedPose, ...] = ()
            if index < len(value.T_imu_cam) and document.get(POSES_UNKNOWN) is not True:
                where = f"{place}.T_imu_cam.{index}"
                at = parse(value.T_imu_cam[index], _Pose, where)
                *position, qx, qy, qz, qw = dict(at).values()
                matrix = base.pose_from_quaternion(position, (qx, qy, qz, qw), where)
                poses = (NamedPose("imu", name, matrix),)
            cameras.append(ParsedCamera(name, lens, poses, 1e-9 * value.cam_time_offset_ns))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[BasaltLens]]) -> str:
        """Text of a file with the key `value0`."""
        poses = [pose for camera in cameras for pose in camera.poses]
        has_imu = any("imu" in (pose.target, pose.source) for pose in poses)
        body = "imu" if has_imu else cameras[0].name
        entries = []
        for camera in cameras:
            pose = find_pose(poses, body, camera.name)
            position, quaternion = base.position_and_quaternion(np.eye(4) if pose is None else pose)
            entries.append(dict(zip(_Pose.model_fields, (*position, *quaternion), strict=True)))
        sizes = [[camera.lens.width_px, camera.lens.height_px] for camera in cameras]
        lenses = [_intrinsics(camera.lens) for camera in cameras]
        value: dict[str, Any] = {"T_imu_cam": entries, "intrinsics": lenses, "resolution": sizes}
        shifts_s = {camera.time_shift_s for camera in cameras}
        if len(shifts_s) > 1:
            raise CalibrationError(f"basalt: expected one time shift, got {sorted(shifts_s)} s")
        if shifts_s != {0.0}:
            value["cam_time_offset_ns"] = round(1e9 * shifts_s.pop())
        data: dict[str, Any] = {"value0": value}
        if not poses:
            data[POSES_UNKNOWN] = True
        return json.dumps(data, indent=4) + "\n"

    def unsupported(self, lens: BasaltLens) -> str | None:
        """Rejects pinhole cameras with distortion."""
        if isinstance(lens, UnifiedCamera) and (any(lens.distortion) or lens.skew_px or lens.xi):
            return "its pinhole camera has no distortion, no skew and no ξ"
        return super().unsupported(lens)

    def camera_name(self, index: int, name: str) -> str:
        """Name made from the index alone."""
        return f"cam{index}"


def _lens(part: dict[str, Any], size: Sequence[int], place: str) -> CentralCamera:
    fields = parse(part, _Intrinsics, place)
    model = fields.camera_type
    documents.check_choice(model, INTRINSICS, f"{place}: camera_type")
    names = INTRINSICS[model].split()
    if set(names) != fields.intrinsics.keys():
        raise unexpected(f"{place}: intrinsics", ", ".join(names), ", ".join(fields.intrinsics))
    width, height = documents.counted(size, "width height", f"{place}: resolution")
    fx, fy, cx, cy, *shape = (fields.intrinsics[name] for name in names)
    intrinsics = base.Intrinsics(int(width), int(height), (fx, fy), (cx, cy))
    with error_context(place):
        if model == "pinhole":
            return base.pinhole(intrinsics)
        if model == "ucm":
            return EucmCamera(*intrinsics, shape[0], 1.0)
        if model == "eucm":
            return EucmCamera(*intrinsics, *shape)
        if model == "ds":
            return DoubleSphereCamera(*intrinsics, *shape)
        if model == "pinhole-radtan8":
            *distortion, radius = shape
            if radius < 0.0:
                raise unexpected(f"{place}: intrinsics.rpmax", "a number ≥ 0", radius)
            limit_rad = math.atan(radius) or math.pi  # 0: no limit
            return RationalPolynomialCamera(*intrinsics, tuple(distortion), limit_rad)
        return KannalaBrandtCamera(*intrinsics, tuple(shape))


def _intrinsics(lens: BasaltLens) -> dict[str, Any]:
    model, shape = "pinhole", tuple[float, ...]()
    if isinstance(lens, DoubleSphereCamera):
        model, shape = "ds", (lens.xi, lens.alpha)
    elif isinstance(lens, EucmCamera):
        model, shape = "eucm", (lens.alpha, lens.beta)
        if lens.beta == 1.0:
            model, shape = "ucm", (lens.alpha,)
    elif isinstance(lens, KannalaBrandtCamera):
        model, shape = "kb4", lens.coefficients
    elif isinstance(lens, RationalPolynomialCamera):
        limit_rad = lens.domain_limit_rad
        radius = math.tan(limit_rad) if limit_rad is not None and limit_rad < 0.5 * math.pi else 0.0
        model, shape = "pinhole-radtan8", (*lens.distortion[:8], radius)
    values = (*lens.focal_lengths_px, *lens.principal_point_px, *shape)
    named = dict(zip(INTRINSICS[model].split(), values, strict=True))
    return {"camera_type": model, "intrinsics": named}
