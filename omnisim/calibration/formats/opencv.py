"""OpenCV's calibrations as cv2.FileStorage writes them: omnidir, fisheye, and pinhole.

| format | matrices | here |
| --- | --- | --- |
| opencv_omnidir | K with skew, D = k1 k2 p1 p2, xi | unified |
| opencv_fisheye | K, D = k1 k2 k3 k4 | kannala_brandt |
| opencv_pinhole | K, D = k1 k2 p1 p2 (k3 (k4 k5 k6)) | perspective, unified with ξ = 0 |

The matrices are `camera_matrix` and `distortion_coefficients`, or `K` and `D`; the size is
`image_width` and `image_height`, or `image_size`. Pixels count from the first one's centre, as
ours. Four coefficients without xi may be a fisheye's or a pinhole's: `fisheye_model` says which,
as OpenCV's own calibration program writes it, or the format that is asked for.

Beware: cv2.fisheye is wrong past 90°, and cv2.omnidir projects rays past the fold silently.

Source: OpenCV's modules calib3d and ccalib, and their calibration programs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from omnisim.calibration.documents import parse_yaml
from omnisim.calibration.fields import Foreign, Numbers, Size, counted, parse
from omnisim.calibration.formats.brown import brown_pinhole
from omnisim.calibration.formats.format import NO_SKEW, Format, Said, making, nameless
from omnisim.calibration.formats.numerals import yaml_float, yaml_floats
from omnisim.calibration.formats.pinholes import as_pinhole, refuse_k3
from omnisim.cameras import KannalaBrandtCamera, UnifiedCamera
from omnisim.errors import CalibrationError
from omnisim.parameters import Number

MATRIX_KEYS = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K")
DISTORTION_KEYS = (
    "distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "D",
)  # fmt: skip
IS_YAML = re.compile(r"\A\s*%YAML|!!opencv-matrix")
HAS_XI = re.compile(r"^[ \t]*xi[ \t]*:", re.M)
IS_FISHEYE = re.compile(r"^[ \t]*fisheye_model[ \t]*:[ \t]*1\b", re.M)
IS_PINHOLE = re.compile(r"^[ \t]*fisheye_model[ \t]*:[ \t]*0\b", re.M)


class _Picture(Foreign):
    image_width: Size
    image_height: Size


class _Matrix(Foreign):
    rows: int
    cols: int
    data: Numbers


class _Xi(Foreign):
    xi: Number


def _is_opencv(text: str) -> bool:
    return bool(IS_YAML.search(text)) and "!!opencv-matrix" in text


def _is_omnidir(text: str) -> bool:
    return _is_opencv(text) and bool(HAS_XI.search(text))


def _is_fisheye(text: str) -> bool:
    return _is_opencv(text) and not _is_omnidir(text) and bool(IS_FISHEYE.search(text))


def _is_pinhole(text: str) -> bool:
    return _is_opencv(text) and not (_is_omnidir(text) or _is_fisheye(text))


def _read(wanted: str, text: str, source: str) -> list[Said]:
    data = parse_yaml(text, source)
    if "image_size" in data and "image_width" not in data:
        size = data["image_size"]
        size = size.get("data") if isinstance(size, dict) else size
        if isinstance(size, list) and len(size) == 2:
            data["image_width"], data["image_height"] = size
    picture = parse(data, _Picture, source)
    size_px = picture.image_width, picture.image_height
    key, matrix = _matrix(data, MATRIX_KEYS, source)
    k = counted(matrix, "fx skew cx 0 fy cy 0 0 1", f"{source}: {key}")
    if [k[3], *k[6:]] != [0.0, 0.0, 0.0, 1.0]:
        raise CalibrationError(f"{source}: {key} = {k}: want [fx, s, cx, 0, fy, cy, 0, 0, 1]")
    key_of_d, coefficients = _matrix(data, DISTORTION_KEYS, source)
    place = f"{source}: {key_of_d}"
    focal, centre, skew = (k[0], k[4]), (k[2], k[5]), k[1]
    with making(source):
        if wanted == "opencv_omnidir":
            four = tuple(counted(coefficients, "k1 k2 p1 p2", place))
            return [
                Said(
                    "camera", UnifiedCamera(*size_px, focal, centre, _xi(data, source), four, skew)
                )
            ]
        if skew:  # cv2's projections leave it out
            raise CalibrationError(f"{source}: {key} has the skew {skew:g}: want 0")
        if wanted == "opencv_fisheye":
            four = tuple(counted(coefficients, "k1 k2 k3 k4", place))
            return [Said("camera", KannalaBrandtCamera(*size_px, focal, centre, four))]
        pinhole, notes = brown_pinhole(size_px, focal, centre, coefficients, place)
        return [Said("camera", pinhole, notes=notes)]


def _unclear(text: str, source: str) -> str | None:
    """Four coefficients may be a fisheye's or a pinhole's."""
    key, coefficients = _matrix(parse_yaml(text, source), DISTORTION_KEYS, source)
    if len(coefficients) != 4 or IS_PINHOLE.search(text):
        return None
    return (
        f"{key}: 4 numbers, of a fisheye or of a pinhole camera: pass --format opencv_fisheye or "
        "opencv_pinhole, or say fisheye_model: 1 or 0 in the file"
    )


def _matrix(data: dict[str, Any], keys: Sequence[str], source: str) -> tuple[str, list[float]]:
    key = next((key for key in keys if key in data), None)
    if key is None:
        raise CalibrationError(f"{source}: {keys[0]}: missing")
    matrix = parse(data[key], _Matrix, f"{source}: {key}")
    if len(matrix.data) != matrix.rows * matrix.cols:
        raise CalibrationError(
            f"{source}: {key}: {len(matrix.data)} numbers for {matrix.rows} × {matrix.cols}"
        )
    return key, list(matrix.data)


def _xi(data: dict[str, Any], source: str) -> float:
    xi = data.get("xi")
    if isinstance(xi, dict):
        return counted(parse(xi, _Matrix, f"{source}: xi").data, "xi", f"{source}: xi")[0]
    return parse(data, _Xi, source).xi


def _write(cameras: Sequence[Said]) -> str:
    (camera,) = cameras
    lens: Any = camera.lens
    (fx, fy), (cx, cy) = lens.focal_lengths_px, lens.principal_point_px
    skew = getattr(lens, "skew_px", 0.0)
    is_fisheye = isinstance(lens, KannalaBrandtCamera)
    distortion = lens.coefficients if is_fisheye else lens.distortion
    text = f"%YAML:1.0\n---\nimage_width: {lens.width_px}\nimage_height: {lens.height_px}\n"
    text += _matrix_text("camera_matrix", 3, 3, [fx, skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
    text += _matrix_text("distortion_coefficients", len(distortion), 1, distortion)
    return text


def _matrix_text(key: str, rows: int, columns: int, values: Sequence[float]) -> str:
    return (
        f"{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n"
        f"   data: {yaml_floats(values)}\n"
    )


def _write_omnidir(cameras: Sequence[Said]) -> str:
    lens: Any = cameras[0].lens
    return _write(cameras) + f"xi: {yaml_float(lens.xi)}\n"


def _write_fisheye(cameras: Sequence[Said]) -> str:
    return _write(cameras) + "fisheye_model: 1\n"


def _write_pinhole(cameras: Sequence[Said]) -> str:
    return _write(cameras) + "fisheye_model: 0\n"


def _refuse_pinhole(lens: Any) -> str | None:
    if not as_pinhole(lens):
        return "it has no ξ"
    return "it has no skew" if lens.skew_px else None


def _format(
    name: str,
    title: str,
    looks_like: Callable[[str], bool],
    write: Callable[[Sequence[Said]], str],
    model: type[Any],
    fixed: dict[str, float],
    refuse: Callable[[Any], str | None] = lambda lens: None,
    widest_rad: float | None = None,
    unclear: Callable[[str, str], str | None] = lambda text, source: None,
    doubt: str = "",
) -> Format:
    return Format(
        name, f"OpenCV: {title}", ".yaml", looks_like, partial(_read, name), write, (model,),
        ((model, fixed),), refuse, widest_rad=widest_rad, unclear=unclear, rename=nameless,
        doubtful_past_rad=0.5 * math.pi if doubt else math.inf, doubt=doubt,
    )  # fmt: skip


OPENCV_OMNIDIR = _format(
    "opencv_omnidir",
    "omnidir yaml",
    _is_omnidir,
    _write_omnidir,
    UnifiedCamera,
    NO_SKEW,
    refuse_k3,
)
OPENCV_FISHEYE = _format(
    "opencv_fisheye", "fisheye yaml", _is_fisheye, _write_fisheye, KannalaBrandtCamera, {},
    doubt="cv2.fisheye's own projection is wrong past 90°",
)  # fmt: skip
OPENCV_PINHOLE = _format(
    "opencv_pinhole", "pinhole yaml", _is_pinhole, _write_pinhole, UnifiedCamera, {"xi": 0.0},
    _refuse_pinhole, 0.5 * math.pi, _unclear,
)  # fmt: skip
