"""Kalibr's camchain.yaml.

| camera_model | intrinsics | distortion_model | here |
| --- | --- | --- | --- |
| pinhole | fu fv pu pv | radtan, none | perspective, unified with ξ = 0 |
| pinhole | fu fv pu pv | equidistant | kannala_brandt |
| pinhole | fu fv pu pv | fov | fitted: no model of ours is it |
| omni | xi fu fv pu pv | radtan, none | unified |
| ds | xi alpha fu fv pu pv | none | double_sphere |
| eucm | alpha beta fu fv pu pv | none | eucm |

Pixels count from the first one's centre, as ours. `T_cn_cnm1` takes the camera before to this one,
`T_cam_imu` the IMU to it. Kalibr reads floats only, so that all numbers are written with a point.

Source: Kalibr's wiki, "YAML formats" and "Supported models".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from omnisim.calibration.calibration import Pose, find_pose
from omnisim.calibration.distorted_pinhole import FovLens, nearest_lens
from omnisim.calibration.documents import parse_yaml
from omnisim.calibration.fields import Foreign, Matrix, Numbers, Size, counted, parse, pose
from omnisim.calibration.formats.format import NO_SKEW, Format, Said, making
from omnisim.calibration.formats.numerals import yaml_floats
from omnisim.calibration.formats.pinholes import pinhole, refuse_k3_and_skew
from omnisim.cameras import (
    CentralCamera,
    DoubleSphereCamera,
    EucmCamera,
    KannalaBrandtCamera,
    UnifiedCamera,
)
from omnisim.errors import CalibrationError
from omnisim.parameters import Number

INTRINSICS = {
    "pinhole": "fu fv pu pv",
    "omni": "xi fu fv pu pv",
    "ds": "xi alpha fu fv pu pv",
    "eucm": "alpha beta fu fv pu pv",
}
DISTORTIONS = {"radtan": "k1 k2 p1 p2", "equidistant": "k1 k2 k3 k4", "fov": "w", "none": ""}
PAIRS = {
    "pinhole": ("radtan", "equidistant", "fov", "none"),
    "omni": ("radtan", "none"),
    "ds": ("none",),
    "eucm": ("none",),
}


class _Camera(Foreign):
    camera_model: str
    intrinsics: Numbers
    distortion_model: str
    distortion_coeffs: tuple[Number, ...] = ()
    resolution: list[Size]
    T_cn_cnm1: Matrix | None = None
    T_cam_imu: Matrix | None = None


_MODEL = re.compile(r"""(?:^|[{,])[ \t]*["']?camera_model["']?[ \t]*:""", re.M)


def _looks_like(text: str) -> bool:
    is_json = text.lstrip().startswith("{")
    return not is_json and bool(_MODEL.search(text)) and "intrinsics" in text


def _read(text: str, source: str) -> list[Said]:
    data = parse_yaml(text, source)
    cameras = {
        name: part
        for name, part in data.items()
        if isinstance(part, dict) and {"camera_model", "intrinsics"} & part.keys()
    }
    if not cameras:
        raise CalibrationError(f"{source}: no camera: want cam0: with camera_model, intrinsics, …")
    said, before = [], None
    for name, part in cameras.items():
        place = f"{source}: {name}"
        fields = parse(part, _Camera, place)
        lens, notes = _lens(fields, place)
        said.append(Said(name, lens, tuple(_poses(fields, name, before, place)), notes))
        before = name
    return said


def _lens(fields: _Camera, place: str) -> tuple[CentralCamera, tuple[str, ...]]:
    model, distortion = fields.camera_model, fields.distortion_model
    if model not in INTRINSICS:
        wanted = ", ".join(INTRINSICS)
        raise CalibrationError(f"{place}: camera_model = {model!r}: want one of {wanted}")
    if distortion not in PAIRS[model]:
        raise CalibrationError(
            f"{place}: distortion_model = {distortion!r} with camera_model = {model!r}: want "
            + " or ".join(PAIRS[model])
        )
    numbers = counted(fields.intrinsics, INTRINSICS[model], f"{place}: intrinsics")
    coefficients = counted(
        fields.distortion_coeffs, DISTORTIONS[distortion], f"{place}: distortion_coeffs"
    )
    width, height = counted(fields.resolution, "width height", f"{place}: resolution")
    size = int(width), int(height)
    *shape, fu, fv, pu, pv = numbers
    with making(place):
        if model == "ds":
            return DoubleSphereCamera(*size, (fu, fv), (pu, pv), *shape), ()
        if model == "eucm":
            return EucmCamera(*size, (fu, fv), (pu, pv), *shape), ()
        if distortion == "equidistant":
            return KannalaBrandtCamera(*size, (fu, fv), (pu, pv), tuple(coefficients)), ()
        if distortion == "fov":
            return nearest_lens(FovLens(*size, (fu, fv), (pu, pv), coefficients[0]), place)
        coefficients = coefficients or [0.0] * 4
        if model == "omni":
            return UnifiedCamera(*size, (fu, fv), (pu, pv), *shape, tuple(coefficients)), ()
        return pinhole(size, (fu, fv), (pu, pv), coefficients), ()


def _poses(fields: _Camera, name: str, before: str | None, place: str) -> list[Pose]:
    poses = []
    if fields.T_cn_cnm1 is not None and before is not None:
        poses.append(Pose(name, before, pose(fields.T_cn_cnm1, f"{place}: T_cn_cnm1")))
    if fields.T_cam_imu is not None:
        poses.append(Pose(name, "imu", pose(fields.T_cam_imu, f"{place}: T_cam_imu")))
    return poses


def _write(cameras: Sequence[Said]) -> str:
    poses = [pose for camera in cameras for pose in camera.poses]
    text, before = "", None
    for camera in cameras:
        model, numbers, distortion, coefficients = _words(camera.lens)
        text += f"{camera.name}:\n"
        for key, source in (("T_cn_cnm1", before), ("T_cam_imu", "imu")):
            matrix = find_pose(poses, camera.name, source) if source else None
            if matrix is not None:
                text += f"  {key}:\n"
                text += "".join(f"  - {yaml_floats(row)}\n" for row in matrix.tolist())
        text += f"  camera_model: {model}\n"
        text += f"  distortion_coeffs: {yaml_floats(coefficients)}\n"
        text += f"  distortion_model: {distortion}\n"
        text += f"  intrinsics: {yaml_floats(numbers)}\n"
        text += f"  resolution: [{camera.lens.width_px}, {camera.lens.height_px}]\n"
        text += f"  rostopic: /{camera.name}/image_raw\n"
        before = camera.name
    return text


def _words(lens: Any) -> tuple[str, tuple[float, ...], str, tuple[float, ...]]:
    end = (*lens.focal_lengths_px, *lens.principal_point_px)
    if isinstance(lens, DoubleSphereCamera):
        return "ds", (lens.xi, lens.alpha, *end), "none", ()
    if isinstance(lens, EucmCamera):
        return "eucm", (lens.alpha, lens.beta, *end), "none", ()
    if isinstance(lens, KannalaBrandtCamera):
        return "pinhole", end, "equidistant", lens.coefficients
    if lens.xi == 0.0:
        return "pinhole", end, "radtan", lens.distortion[:4]
    return "omni", (lens.xi, *end), "radtan", lens.distortion[:4]


def _rename(index: int, name: str) -> str:
    return name if re.fullmatch(r"cam\d+", name, re.ASCII) else f"cam{index}"


MODELS = (UnifiedCamera, KannalaBrandtCamera, EucmCamera, DoubleSphereCamera)
KALIBR = Format(
    "kalibr",
    "Kalibr: camchain.yaml",
    ".yaml",
    _looks_like,
    _read,
    _write,
    MODELS,
    tuple((model, NO_SKEW if model is UnifiedCamera else {}) for model in MODELS),
    refuse_k3_and_skew,
    several=True,
    rename=_rename,
)
