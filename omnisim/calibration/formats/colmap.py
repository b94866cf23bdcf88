"""COLMAP's cameras.txt: a camera a line, `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`.

| MODEL | here |
| --- | --- |
| SIMPLE_PINHOLE, PINHOLE | perspective, unified with ξ = 0 |
| SIMPLE_RADIAL, RADIAL, OPENCV | unified with ξ = 0 |
| FULL_OPENCV, FOV | fitted where no model of ours is it |
| SIMPLE_FISHEYE, FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, OPENCV_FISHEYE | kannala_brandt |
| THIN_PRISM_FISHEYE without prism and tangential part | kannala_brandt |
| EUCM | eucm |
| EQUIRECTANGULAR | equirectangular |

COLMAP's first pixel has its centre at (0.5, 0.5), ours at (0, 0). There are no poses: they are in
images.txt. COLMAP's own projection of fisheyes ends at 90°.

Source: COLMAP's documentation, "Camera Models" and "Output Format".
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from omnisim.calibration.distorted_pinhole import FovLens, nearest_lens
from omnisim.calibration.fields import LARGEST_SIZE_PX, counted, short
from omnisim.calibration.formats.brown import brown_pinhole
from omnisim.calibration.formats.format import Format, Said, making
from omnisim.calibration.formats.pinholes import as_pinhole, pinhole
from omnisim.cameras import (
    CentralCamera,
    EquirectangularCamera,
    EucmCamera,
    KannalaBrandtCamera,
    UnifiedCamera,
)
from omnisim.errors import CalibrationError

MODELS = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "FOV": "fx fy cx cy omega",
    "SIMPLE_FISHEYE": "f cx cy",
    "FISHEYE": "fx fy cx cy",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
    "THIN_PRISM_FISHEYE": "fx fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1",
    "EUCM": "fx fy cx cy alpha beta",
    "EQUIRECTANGULAR": "w h",
}
CENTRE_PX = 0.5  # of the first pixel
_LINE = re.compile(r"^[ \t]*\d+[ \t]+[A-Z][A-Z_]+[ \t]+\d+[ \t]+\d+([ \t]+\S+)+[ \t\r]*$", re.M)


def _looks_like(text: str) -> bool:
    return bool(_LINE.search(text)) or "CAMERA_ID, MODEL, WIDTH, HEIGHT" in text


def _read(text: str, source: str) -> list[Said]:
    said = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        place = f"{source}: line {number}"
        if len(words) < 5:
            raise CalibrationError(f"{place}: want CAMERA_ID MODEL WIDTH HEIGHT PARAMS…")
        name, model, *numbers = words
        if model not in MODELS:
            raise CalibrationError(
                f"{place}: MODEL = {model[:40]}: want one of " + ", ".join(MODELS)
            )
        values = [_number(word, place) for word in numbers]
        width, height = (_size(value, place) for value in values[:2])
        parameters = counted(values[2:], MODELS[model], f"{place}: {model}")
        lens, notes = _lens(model, (width, height), parameters, place)
        said.append(Said(name, lens, notes=notes))
    if not said:
        raise CalibrationError(f"{source}: no camera: want CAMERA_ID MODEL WIDTH HEIGHT PARAMS…")
    return said


def _number(word: str, place: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CalibrationError(f"{place}: {short(word)}: want a number")
    return value


def _size(value: float, place: str) -> int:
    if not (1 <= value <= LARGEST_SIZE_PX and value == int(value)):
        raise CalibrationError(f"{place}: size {value:g}: want 1 to {LARGEST_SIZE_PX}")
    return int(value)


def _lens(
    model: str, size: tuple[int, int], values: list[float], place: str
) -> tuple[CentralCamera, tuple[str, ...]]:
    if model == "EQUIRECTANGULAR":
        if tuple(values) != size:
            raise CalibrationError(f"{place}: {model} of {values} in a picture of {size}")
        return EquirectangularCamera(*size), ()
    has_one_focal = MODELS[model].startswith("f ")
    focal = (values[0], values[0]) if has_one_focal else (values[0], values[1])
    u, v, *shape = values[1 if has_one_focal else 2 :]
    centre = u - CENTRE_PX, v - CENTRE_PX
    four = (*shape, 0.0, 0.0, 0.0, 0.0)[:4]
    with making(place):
        if model == "EUCM":
            return EucmCamera(*size, focal, centre, *shape), ()
        if model == "FOV":
            return nearest_lens(FovLens(*size, focal, centre, *shape), place)
        if model == "FULL_OPENCV":
            return brown_pinhole(size, focal, centre, shape, place)
        if model == "THIN_PRISM_FISHEYE":
            k1, k2, p1, p2, k3, k4, sx, sy = shape
            if p1 or p2 or sx or sy:
                raise CalibrationError(f"{place}: {model}: want p1, p2, sx1, sy1 = 0: we have none")
            four = k1, k2, k3, k4
        if model.endswith("FISHEYE"):
            return KannalaBrandtCamera(*size, focal, centre, four), ()
        return pinhole(size, focal, centre, four), ()


def _write(cameras: Sequence[Said]) -> str:
    text = "# Camera list with one line of data per camera:\n"
    text += "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
    text += f"# Number of cameras: {len(cameras)}\n"
    for camera in cameras:
        model, values = _words(camera.lens)
        numbers = " ".join(repr(float(value)) for value in values)
        text += f"{camera.name} {model} {camera.lens.width_px} {camera.lens.height_px} {numbers}\n"
    return text


def _words(lens: Any) -> tuple[str, tuple[float, ...]]:
    if isinstance(lens, EquirectangularCamera):
        return "EQUIRECTANGULAR", (lens.width_px, lens.height_px)
    (fx, fy), (u, v) = lens.focal_lengths_px, lens.principal_point_px
    start = fx, fy, u + CENTRE_PX, v + CENTRE_PX
    if isinstance(lens, EucmCamera):
        return "EUCM", (*start, lens.alpha, lens.beta)
    if isinstance(lens, KannalaBrandtCamera):
        return "OPENCV_FISHEYE", (*start, *lens.coefficients)
    if lens.k3:
        return "FULL_OPENCV", (*start, *lens.distortion, 0.0, 0.0, 0.0)
    if any(lens.distortion):
        return "OPENCV", (*start, *lens.distortion)
    return "PINHOLE", start


def _refuse(lens: Any) -> str | None:
    if not isinstance(lens, UnifiedCamera):
        return None
    if not as_pinhole(lens):
        return "it has no ξ"
    return "it has no skew" if lens.skew_px else None


def _rename(index: int, name: str) -> str:
    return name if name.isascii() and name.isdecimal() else str(index + 1)


COLMAP = Format(
    "colmap",
    "COLMAP: cameras.txt",
    ".txt",
    _looks_like,
    _read,
    _write,
    (UnifiedCamera, KannalaBrandtCamera, EucmCamera, EquirectangularCamera),
    ((KannalaBrandtCamera, {}), (EucmCamera, {}), (UnifiedCamera, {"xi": 0.0})),
    _refuse,
    doubtful_past_rad=0.5 * math.pi,
    doubt="COLMAP's own projection ends at 90°",
    several=True,
    rename=_rename,
)
