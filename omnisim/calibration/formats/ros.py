"""ROS's CameraInfo as camera_info_manager keeps it in yaml files.

| distortion_model | D | here |
| --- | --- | --- |
| plumb_bob | k1 k2 p1 p2 k3 | perspective, unified with ξ = 0 |
| rational_polynomial | k1 k2 p1 p2 k3 k4 k5 k6 | the same; fitted where k4, k5, k6 are not 0 |
| equidistant (fisheye) | k1 k2 k3 k4 | kannala_brandt |

Pixels count from the first one's centre, as ours. There is no model for rays at or past 90° from
the axis: `P` and every rectified picture are a plane's.

Source: sensor_msgs/CameraInfo, image_pipeline/CameraInfo.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

from omnisim.calibration.documents import parse_yaml
from omnisim.calibration.fields import Foreign, Numbers, Size, counted, parse
from omnisim.calibration.formats.brown import brown_pinhole
from omnisim.calibration.formats.format import Format, Said, making
from omnisim.calibration.formats.numerals import yaml_floats
from omnisim.calibration.formats.pinholes import as_pinhole
from omnisim.cameras import CentralCamera, KannalaBrandtCamera, UnifiedCamera
from omnisim.errors import CalibrationError

MATRIX = "fx skew cx 0 fy cy 0 0 1"
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class _Matrix(Foreign):
    data: Numbers


class _Camera(Foreign):
    image_width: Size
    image_height: Size
    camera_name: str = "camera"
    camera_matrix: _Matrix
    distortion_model: str
    distortion_coefficients: _Matrix


def _looks_like(text: str) -> bool:
    keys = ("camera_matrix", "distortion_model|projection_matrix|rectification_matrix")
    return (
        not text.lstrip().startswith("{")
        and "!!opencv-matrix" not in text
        and all(re.search(rf"^({key})[ \t]*:", text, re.M) for key in keys)
    )


def _read(text: str, source: str) -> list[Said]:
    fields = parse(parse_yaml(text, source), _Camera, source)
    lens, notes = camera_info_lens(
        (fields.image_width, fields.image_height),
        fields.distortion_model,
        fields.camera_matrix.data,
        fields.distortion_coefficients.data,
        source,
        ("camera_matrix", "distortion_coefficients"),
    )
    return [Said(fields.camera_name or "camera", lens, notes=notes)]


def camera_info_lens(
    size_px: tuple[int, int],
    model: str,
    matrix: Sequence[float],
    coefficients: Sequence[float],
    source: str,
    keys: tuple[str, str],
) -> tuple[CentralCamera, tuple[str, ...]]:
    """The lens of a CameraInfo, and notes.

    Args:
        size_px: of the picture.
        model: its distortion_model.
        matrix, coefficients: K, row by row, and D.
        source: names the file in messages.
        keys: names of K and D in it.

    Raises:
        CalibrationError: a model that is none, or numbers that do not fit it.
    """
    k = counted(matrix, MATRIX, f"{source}: {keys[0]}")
    if [k[3], *k[6:]] != [0.0, 0.0, 0.0, 1.0]:
        raise CalibrationError(f"{source}: {keys[0]} = {k}: want [fx, 0, cx, 0, fy, cy, 0, 0, 1]")
    focal, centre, skew = (k[0], k[4]), (k[2], k[5]), k[1]
    place = f"{source}: {keys[1]}"
    if skew:
        raise CalibrationError(f"{source}: {keys[0]} has the skew {skew:g}: want 0")
    with making(source):
        if model in ("equidistant", "fisheye", "kannala_brandt"):
            four = tuple(counted(coefficients, "k1 k2 k3 k4", place))
            return KannalaBrandtCamera(*size_px, focal, centre, four), ()
        if model in ("plumb_bob", "rational_polynomial", ""):
            return brown_pinhole(size_px, focal, centre, coefficients, place)
    raise CalibrationError(
        f"{source}: distortion_model = {model!r}: want plumb_bob, rational_polynomial or "
        "equidistant"
    )


def camera_info_numbers(lens: Any) -> tuple[str, list[float], list[float], list[float]]:
    """Distortion model as ROS calls it, D, K, and P of a lens."""
    (fx, fy), (cx, cy) = lens.focal_lengths_px, lens.principal_point_px
    k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    if isinstance(lens, KannalaBrandtCamera):
        return "equidistant", list(lens.coefficients), k, p
    return "plumb_bob", [*lens.distortion[:4], lens.k3], k, p


def _write(cameras: Sequence[Said]) -> str:
    (camera,) = cameras
    model, d, k, p = camera_info_numbers(camera.lens)
    text = f"image_width: {camera.lens.width_px}\nimage_height: {camera.lens.height_px}\n"
    text += f"camera_name: {json.dumps(camera.name)}\n"
    text += _matrix_text("camera_matrix", 3, 3, k)
    text += f"distortion_model: {model}\n"
    text += _matrix_text("distortion_coefficients", 1, len(d), d)
    text += _matrix_text("rectification_matrix", 3, 3, IDENTITY)
    return text + _matrix_text("projection_matrix", 3, 4, p)


def _matrix_text(key: str, rows: int, columns: int, values: Sequence[float]) -> str:
    return f"{key}:\n  rows: {rows}\n  cols: {columns}\n  data: {yaml_floats(values)}\n"


def refuse_no_pinhole(lens: Any) -> str | None:
    """Why CameraInfo cannot say a lens."""
    if isinstance(lens, KannalaBrandtCamera):
        return None
    if not as_pinhole(lens):
        return "it has no model with ξ"
    return "it has no skew" if lens.skew_px else None


CAMERA_INFO_MODELS = (UnifiedCamera, KannalaBrandtCamera)
CAMERA_INFO_FITS: tuple[tuple[type[Any], dict[str, float]], ...] = (
    (UnifiedCamera, {"xi": 0.0}),
    (KannalaBrandtCamera, {}),
)
ROS = Format(
    "ros",
    "ROS: CameraInfo yaml",
    ".yaml",
    _looks_like,
    _read,
    _write,
    CAMERA_INFO_MODELS,
    CAMERA_INFO_FITS,
    refuse_no_pinhole,
    widest_rad=0.5 * math.pi,
)
