"""WoodScape's calibration json.

    ρ = k1 θ + k2 θ² + k3 θ³ + k4 θ⁴ in pixels
    u = ρ X/χ + cx_offset + width/2 − 0.5,  v = a ρ Y/χ + cy_offset + height/2 − 0.5

a is `aspect_ratio`; ours is 1, which all of the data set's are; another one with odd powers alone
is a Kannala-Brandt lens. Pixels count from the first one's centre, as ours. `extrinsic` takes the
camera to the vehicle (x forward, y left, z up); its quaternion is x, y, z, w.

Source: WoodScape's repository, calibration and its example of a projection.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from omnisim.calibration.calibration import Pose, find_pose
from omnisim.calibration.documents import parse_json
from omnisim.calibration.fields import Foreign, Numbers, Size, counted, parse
from omnisim.calibration.formats.format import Format, Remarks, Said, making
from omnisim.calibration.formats.quaternions import pose_of, position_and_quaternion
from omnisim.cameras import CentralCamera, FThetaCamera, KannalaBrandtCamera
from omnisim.errors import CalibrationError
from omnisim.parameters import Number


class _Intrinsic(Foreign):
    model: str = "radial_poly"
    poly_order: Number = 4
    aspect_ratio: Number = 1.0
    cx_offset: Number
    cy_offset: Number
    width: Size
    height: Size
    k1: Number
    k2: Number
    k3: Number
    k4: Number


class _Extrinsic(Foreign):
    quaternion: Numbers
    translation: Numbers


class _File(Foreign):
    name: str = "camera"
    intrinsic: dict[str, Any]
    extrinsic: dict[str, Any] | None = None


def _looks_like(text: str) -> bool:
    return bool(re.search(r'"cx_offset"\s*:|"radial_poly"', text))


def _read(text: str, source: str) -> list[Said]:
    file = parse(parse_json(text, source), _File, source)
    intrinsic = parse(file.intrinsic, _Intrinsic, f"{source}: intrinsic")
    name = file.name or "camera"
    poses: tuple[Pose, ...] = ()
    if file.extrinsic is not None:
        place = f"{source}: extrinsic"
        extrinsic = parse(file.extrinsic, _Extrinsic, place)
        position = counted(extrinsic.translation, "x y z", f"{place}: translation")
        quaternion = counted(extrinsic.quaternion, "x y z w", f"{place}: quaternion")
        poses = (Pose("vehicle", name, pose_of(position, quaternion, place)),)
    with making(f"{source}: intrinsic"):
        return [Said(name, _lens(intrinsic, f"{source}: intrinsic"), poses)]


def _lens(part: _Intrinsic, place: str) -> CentralCamera:
    if part.poly_order != 4:
        raise CalibrationError(f"{place}: poly_order = {part.poly_order:g}: want 4")
    if part.model != "radial_poly":
        raise CalibrationError(f"{place}: model = {part.model!r}: want radial_poly")
    centre = (
        part.cx_offset + 0.5 * part.width - 0.5,
        part.cy_offset + 0.5 * part.height - 0.5,
    )
    coefficients = part.k1, part.k2, part.k3, part.k4
    if part.aspect_ratio == 1.0:
        return FThetaCamera(part.width, part.height, centre, coefficients)
    if part.k2 or part.k4 or part.k1 <= 0.0:
        raise CalibrationError(
            f"{place}: aspect_ratio = {part.aspect_ratio:g}: want 1: omnisim's f-theta lens has "
            "square pixels"
        )
    focal = part.k1, part.k1 * part.aspect_ratio
    odd = (part.k3 / part.k1, 0.0, 0.0, 0.0)
    return KannalaBrandtCamera(part.width, part.height, focal, centre, odd)


def _write(cameras: Sequence[Said]) -> str:
    (camera,) = cameras
    lens: Any = camera.lens
    k1, k2, k3, k4 = (*lens.coefficients_px, 0.0, 0.0, 0.0)[:4]
    u, v = lens.principal_point_px
    told: dict[str, Any] = {
        "intrinsic": {
            "aspect_ratio": 1.0,
            "cx_offset": u - (0.5 * lens.width_px - 0.5),
            "cy_offset": v - (0.5 * lens.height_px - 0.5),
            "height": float(lens.height_px),
            "k1": k1,
            "k2": k2,
            "k3": k3,
            "k4": k4,
            "model": "radial_poly",
            "poly_order": 4,
            "width": float(lens.width_px),
        },
        "name": camera.name,
    }
    pose = find_pose(camera.poses, "vehicle", camera.name)
    if pose is not None:
        position, quaternion = position_and_quaternion(pose)
        told = {"extrinsic": {"quaternion": quaternion, "translation": position}, **told}
    return json.dumps(told, indent=2) + "\n"


def _refuse(lens: Any) -> str | None:
    return "it has four coefficients" if len(lens.coefficients_px) > 4 else None


WOODSCAPE = Format(
    "woodscape",
    "WoodScape: calibration json",
    ".json",
    _looks_like,
    _read,
    _write,
    (FThetaCamera,),
    ((FThetaCamera, {}),),
    _refuse,
    Remarks.KEY,
)
