"""KITTI-360's fisheye yaml, which is camodocal's, and VINS's too.

| model_type | parameters | here |
| --- | --- | --- |
| MEI | xi; k1 k2 p1 p2; gamma1 gamma2 u0 v0 | unified |
| PINHOLE | k1 k2 p1 p2; fx fy cx cy | perspective, unified with ξ = 0 |
| KANNALA_BRANDT | k2 k3 k4 k5 mu mv u0 v0 | kannala_brandt, k1 … k4 |

Pixels count from the first one's centre, as ours. There are no poses.

Source: camodocal's camera_models; KITTI-360's documentation, "2D fisheye images".
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from omnisim.calibration.documents import parse_yaml
from omnisim.calibration.fields import Foreign, Size, parse
from omnisim.calibration.formats.format import NO_SKEW, Format, Said, making
from omnisim.calibration.formats.numerals import yaml_float
from omnisim.calibration.formats.pinholes import as_pinhole, pinhole, refuse_k3_and_skew
from omnisim.cameras import CentralCamera, KannalaBrandtCamera, UnifiedCamera
from omnisim.errors import CalibrationError
from omnisim.parameters import Number, Table


class _Mirror(Table):
    xi: Number


class _Distortion(Table):
    k1: Number
    k2: Number
    p1: Number
    p2: Number

    @property
    def values(self) -> tuple[float, ...]:
        return self.k1, self.k2, self.p1, self.p2


class _Gammas(Table):
    gamma1: Number
    gamma2: Number
    u0: Number
    v0: Number


class _Focal(Table):
    fx: Number
    fy: Number
    cx: Number
    cy: Number


class _KannalaBrandt(Table):
    k2: Number
    k3: Number
    k4: Number
    k5: Number
    mu: Number
    mv: Number
    u0: Number
    v0: Number


class _Head(Foreign):
    model_type: str
    camera_name: str = "camera"
    image_width: Size
    image_height: Size


class _Mei(_Head):
    mirror_parameters: _Mirror
    distortion_parameters: _Distortion
    projection_parameters: _Gammas


class _Pinhole(_Head):
    distortion_parameters: _Distortion
    projection_parameters: _Focal


class _Fisheye(_Head):
    projection_parameters: _KannalaBrandt


def _looks_like(text: str) -> bool:
    return bool(re.search(r"""^[ \t]*["']?model_type["']?[ \t]*:""", text, re.M))


def _read(text: str, source: str) -> list[Said]:
    data = parse_yaml(text, source)
    if not isinstance(data.get("camera_name", ""), str):  # KITTI-360's is a word, 00 would not be
        data["camera_name"] = str(data["camera_name"])
    head = parse(data, _Head, source)
    with making(source):
        return [Said(head.camera_name or "camera", _lens(head, data, source))]


def _lens(head: _Head, data: dict[str, Any], source: str) -> CentralCamera:
    size = head.image_width, head.image_height
    if head.model_type == "MEI":
        mei = parse(data, _Mei, source)
        plane = mei.projection_parameters
        return UnifiedCamera(
            *size,
            (plane.gamma1, plane.gamma2),
            (plane.u0, plane.v0),
            mei.mirror_parameters.xi,
            mei.distortion_parameters.values,
        )
    if head.model_type == "PINHOLE":
        flat = parse(data, _Pinhole, source)
        focal = flat.projection_parameters
        centre = focal.cx, focal.cy
        return pinhole(size, (focal.fx, focal.fy), centre, flat.distortion_parameters.values)
    if head.model_type == "KANNALA_BRANDT":
        wide = parse(data, _Fisheye, source).projection_parameters
        coefficients = wide.k2, wide.k3, wide.k4, wide.k5
        return KannalaBrandtCamera(*size, (wide.mu, wide.mv), (wide.u0, wide.v0), coefficients)
    raise CalibrationError(
        f"{source}: model_type = {head.model_type!r}: want MEI, PINHOLE or KANNALA_BRANDT"
    )


def _write(cameras: Sequence[Said]) -> str:
    (camera,) = cameras
    lens: Any = camera.lens
    (fu, fv), (u, v) = lens.focal_lengths_px, lens.principal_point_px
    parts: dict[str, dict[str, float]] = {}
    if isinstance(lens, KannalaBrandtCamera):
        model = "KANNALA_BRANDT"
        named = zip(("k2", "k3", "k4", "k5"), lens.coefficients, strict=True)
        parts["projection_parameters"] = {**dict(named), "mu": fu, "mv": fv, "u0": u, "v0": v}
    else:
        model = "PINHOLE" if as_pinhole(lens) else "MEI"
        if model == "MEI":
            parts["mirror_parameters"] = {"xi": lens.xi}
        named = zip(("k1", "k2", "p1", "p2"), lens.distortion[:4], strict=True)
        parts["distortion_parameters"] = dict(named)
        keys = ("gamma1", "gamma2", "u0", "v0") if model == "MEI" else ("fx", "fy", "cx", "cy")
        parts["projection_parameters"] = dict(zip(keys, (fu, fv, u, v), strict=True))
    text = f"%YAML:1.0\n---\nmodel_type: {model}\ncamera_name: {json.dumps(camera.name)}\n"
    text += f"image_width: {lens.width_px}\nimage_height: {lens.height_px}\n"
    for name, values in parts.items():
        text += f"{name}:\n"
        text += "".join(f"   {key}: {yaml_float(value)}\n" for key, value in values.items())
    return text


MODELS = (UnifiedCamera, KannalaBrandtCamera)
KITTI360 = Format(
    "kitti360",
    "KITTI-360 and camodocal: MEI yaml",
    ".yaml",
    _looks_like,
    _read,
    _write,
    MODELS,
    tuple((model, NO_SKEW if model is UnifiedCamera else {}) for model in MODELS),
    refuse_k3_and_skew,
)
