"""Basalt's calibration json.

| camera_type | intrinsics | here |
| --- | --- | --- |
| pinhole | fx fy cx cy | perspective, unified with ξ = 0 |
| ucm | fx fy cx cy alpha | EUCM with β = 1 |
| eucm | … alpha beta | eucm |
| ds | … xi alpha | double_sphere |
| kb4 | … k1 k2 k3 k4 | kannala_brandt |

`T_imu_cam` takes the camera to the IMU; where nobody knows it the first camera stands for the IMU,
which the file's remarks say. Pixels count from the first one's centre, as ours.

Source: basalt-headers, calibration and camera models; Usenko et al. 2018.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.calibration.calibration import Pose, find_pose
from omnisim.calibration.documents import parse_json
from omnisim.calibration.fields import Foreign, Size, counted, parse
from omnisim.calibration.formats.format import Format, Remarks, Said, making
from omnisim.calibration.formats.pinholes import as_pinhole, pinhole
from omnisim.calibration.formats.quaternions import pose_of, position_and_quaternion
from omnisim.cameras import (
    CentralCamera,
    DoubleSphereCamera,
    EucmCamera,
    KannalaBrandtCamera,
    UnifiedCamera,
)
from omnisim.errors import CalibrationError
from omnisim.parameters import Number

FOCAL = "fx fy cx cy"
INTRINSICS = {
    "pinhole": FOCAL,
    "ucm": f"{FOCAL} alpha",
    "eucm": f"{FOCAL} alpha beta",
    "ds": f"{FOCAL} xi alpha",
    "kb4": f"{FOCAL} k1 k2 k3 k4",
}
NOT_KNOWN = "omnisim_poses_not_known"


class _Intrinsics(Foreign):
    camera_type: str
    intrinsics: dict[str, Number]


class _Place(Foreign):
    px: Number
    py: Number
    pz: Number
    qx: Number
    qy: Number
    qz: Number
    qw: Number


class _Value(Foreign):
    T_imu_cam: tuple[dict[str, Any], ...] = ()
    intrinsics: list[dict[str, Any]]
    resolution: list[list[Size]]


def _looks_like(text: str) -> bool:
    return bool(re.search(r'"value0"\s*:', text))


def _read(text: str, source: str) -> list[Said]:
    data = parse_json(text, source)
    place = f"{source}: value0"
    value = parse(data.get("value0"), _Value, place)
    if not value.intrinsics or len(value.resolution) != len(value.intrinsics):
        raise CalibrationError(
            f"{place}: {len(value.intrinsics)} intrinsics and {len(value.resolution)} resolution: "
            "want one of each for every camera"
        )
    said = []
    for index, (part, size) in enumerate(zip(value.intrinsics, value.resolution, strict=True)):
        name = f"cam{index}"
        lens = _lens(part, size, f"{place}.intrinsics.{index}")
        poses: tuple[Pose, ...] = ()
        if index < len(value.T_imu_cam) and data.get(NOT_KNOWN) is not True:
            where = f"{place}.T_imu_cam.{index}"
            at = parse(value.T_imu_cam[index], _Place, where)
            quaternion = (at.qx, at.qy, at.qz, at.qw)
            poses = (Pose("imu", name, pose_of((at.px, at.py, at.pz), quaternion, where)),)
        said.append(Said(name, lens, poses))
    return said


def _lens(part: dict[str, Any], size: Sequence[int], place: str) -> CentralCamera:
    fields = parse(part, _Intrinsics, place)
    model = fields.camera_type
    if model not in INTRINSICS:
        raise CalibrationError(
            f"{place}: camera_type = {model!r}: want one of " + ", ".join(INTRINSICS)
        )
    names = INTRINSICS[model].split()
    if set(names) != fields.intrinsics.keys():
        raise CalibrationError(
            f"{place}: intrinsics = {', '.join(fields.intrinsics)}: want {', '.join(names)}"
        )
    width, height = counted(size, "width height", f"{place}: resolution")
    picture = int(width), int(height)
    fx, fy, cx, cy, *shape = (fields.intrinsics[name] for name in names)
    with making(place):
        if model == "pinhole":
            return pinhole(picture, (fx, fy), (cx, cy))
        if model == "ucm":
            return EucmCamera(*picture, (fx, fy), (cx, cy), shape[0], 1.0)
        if model == "eucm":
            return EucmCamera(*picture, (fx, fy), (cx, cy), *shape)
        if model == "ds":
            return DoubleSphereCamera(*picture, (fx, fy), (cx, cy), *shape)
        return KannalaBrandtCamera(*picture, (fx, fy), (cx, cy), tuple(shape))


def _write(cameras: Sequence[Said]) -> str:
    poses = [pose for camera in cameras for pose in camera.poses]
    body = "imu" if any("imu" in (pose.target, pose.source) for pose in poses) else cameras[0].name
    places = []
    for camera in cameras:
        pose = find_pose(poses, body, camera.name)
        position, quaternion = position_and_quaternion(np.eye(4) if pose is None else pose)
        keys = ("px", "py", "pz", "qx", "qy", "qz", "qw")
        places.append(dict(zip(keys, (*position, *quaternion), strict=True)))
    told: dict[str, Any] = {
        "value0": {
            "T_imu_cam": places,
            "intrinsics": [_words(camera.lens) for camera in cameras],
            "resolution": [[camera.lens.width_px, camera.lens.height_px] for camera in cameras],
        }
    }
    if not poses:
        told[NOT_KNOWN] = True
    return json.dumps(told, indent=4) + "\n"


def _words(lens: Any) -> dict[str, Any]:
    shape: tuple[float, ...]
    if isinstance(lens, DoubleSphereCamera):
        model, shape = "ds", (lens.xi, lens.alpha)
    elif isinstance(lens, EucmCamera):
        model, shape = ("ucm", (lens.alpha,)) if lens.beta == 1.0 else (
            "eucm", (lens.alpha, lens.beta)
        )  # fmt: skip
    elif isinstance(lens, KannalaBrandtCamera):
        model, shape = "kb4", lens.coefficients
    else:
        model, shape = "pinhole", ()
    values = (*lens.focal_lengths_px, *lens.principal_point_px, *shape)
    return {
        "camera_type": model,
        "intrinsics": dict(zip(INTRINSICS[model].split(), values, strict=True)),
    }


def _refuse(lens: Any) -> str | None:
    if not isinstance(lens, UnifiedCamera):
        return None
    if any(lens.distortion) or lens.skew_px or not as_pinhole(lens):
        return "its pinhole camera has no distortion, no skew and no ξ"
    return None


def _rename(index: int, name: str) -> str:
    return f"cam{index}"


BASALT = Format(
    "basalt",
    "Basalt: calibration json",
    ".json",
    _looks_like,
    _read,
    _write,
    (DoubleSphereCamera, KannalaBrandtCamera, EucmCamera, UnifiedCamera),
    ((DoubleSphereCamera, {}), (KannalaBrandtCamera, {}), (EucmCamera, {})),
    _refuse,
    Remarks.KEY,
    several=True,
    rename=_rename,
)
