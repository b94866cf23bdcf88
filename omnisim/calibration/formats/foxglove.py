"""Foxglove's CameraCalibration as json.

The same as ROS's CameraInfo with other names: `kannala_brandt` is ROS's `equidistant`; `fisheye62`
has no model of ours. Pixels count from the first one's centre, as ours.

Source: Foxglove's schemas, foxglove.CameraCalibration.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence

from omnisim.calibration.documents import parse_json
from omnisim.calibration.fields import Foreign, Numbers, Size, parse
from omnisim.calibration.formats.format import Format, Remarks, Said
from omnisim.calibration.formats.ros import (
    CAMERA_INFO_FITS,
    CAMERA_INFO_MODELS,
    IDENTITY,
    camera_info_lens,
    camera_info_numbers,
    refuse_no_pinhole,
)
from omnisim.errors import CalibrationError

MODELS = ("plumb_bob", "rational_polynomial", "kannala_brandt")


class _Camera(Foreign):
    frame_id: str = "camera"
    width: Size
    height: Size
    distortion_model: str
    D: Numbers
    K: Numbers


def _looks_like(text: str) -> bool:
    return text.lstrip().startswith("{") and bool(re.search(r'"distortion_model"\s*:', text))


def _read(text: str, source: str) -> list[Said]:
    fields = parse(parse_json(text, source), _Camera, source)
    if fields.distortion_model not in MODELS:
        raise CalibrationError(
            f"{source}: distortion_model = {fields.distortion_model!r}: want one of "
            + ", ".join(MODELS)
        )
    size = fields.width, fields.height
    lens, notes = camera_info_lens(
        size, fields.distortion_model, fields.K, fields.D, source, ("K", "D")
    )
    return [Said(fields.frame_id or "camera", lens, notes=notes)]


def _write(cameras: Sequence[Said]) -> str:
    (camera,) = cameras
    model, d, k, p = camera_info_numbers(camera.lens)
    told = {
        "timestamp": {"sec": 0, "nsec": 0},
        "frame_id": camera.name,
        "width": camera.lens.width_px,
        "height": camera.lens.height_px,
        "distortion_model": "kannala_brandt" if model == "equidistant" else model,
        "D": d,
        "K": k,
        "R": list(IDENTITY),
        "P": p,
    }
    return json.dumps(told, indent=2) + "\n"


FOXGLOVE = Format(
    "foxglove",
    "Foxglove: CameraCalibration json",
    ".json",
    _looks_like,
    _read,
    _write,
    CAMERA_INFO_MODELS,
    CAMERA_INFO_FITS,
    refuse_no_pinhole,
    Remarks.KEY,
    widest_rad=0.5 * math.pi,
)
