"""COLMAP's cameras.txt: one camera per line, `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`.

| MODEL | model |
| --- | --- |
| SIMPLE_PINHOLE, PINHOLE | perspective, unified with ξ = 0 |
| SIMPLE_RADIAL, RADIAL, OPENCV | unified with ξ = 0 |
| FULL_OPENCV | rational_polynomial, unified with ξ = 0 |
| FOV | fitted |
| SIMPLE_FISHEYE, FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, OPENCV_FISHEYE | kannala_brandt |
| RAD_TAN_THIN_PRISM_FISHEYE | thin_prism_fisheye |
| SIMPLE_DIVISION, DIVISION | division |
| THIN_PRISM_FISHEYE without prism and tangential part | kannala_brandt |
| EUCM | eucm |
| EQUIRECTANGULAR | equirectangular |

The center of COLMAP's first pixel is (0.5, 0.5); omnisim's is (0, 0). The file has no poses: they
are in images.txt. COLMAP's own fisheye projection ends at 90°.

Source: COLMAP's documentation, "Camera Models" and "Output Format".
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from omnisim.cameras import (
    CentralCamera,
    DivisionCamera,
    EquirectangularCamera,
    EucmCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
    ThinPrismFisheyeCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.documents import unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.errors import CalibrationError

MODELS = {
    "SIMPLE_PINHOLE": "f cx cy", "PINHOLE": "fx fy cx cy", "SIMPLE_RADIAL": "f cx cy k",
    "RADIAL": "f cx cy k1 k2", "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6", "FOV": "fx fy cx cy omega",
    "SIMPLE_FISHEYE": "f cx cy", "FISHEYE": "fx fy cx cy", "SIMPLE_RADIAL_FISHEYE": "f cx cy k",
    "RADIAL_FISHEYE": "f cx cy k1 k2", "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
    "THIN_PRISM_FISHEYE": "fx fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1",
    "RAD_TAN_THIN_PRISM_FISHEYE": "fx fy cx cy k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3",
    "SIMPLE_DIVISION": "f cx cy k", "DIVISION": "fx fy cx cy k",
    "EUCM": "fx fy cx cy alpha beta", "EQUIRECTANGULAR": "w h",
}  # fmt: skip
LINE = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS…"
CENTER_PX = 0.5  # center of the first pixel
_Pinhole = UnifiedCamera | RationalPolynomialCamera
ColmapLens = (
    _Pinhole
    | KannalaBrandtCamera
    | ThinPrismFisheyeCamera
    | DivisionCamera
    | EucmCamera
    | EquirectangularCamera
)


class Colmap(Format[ColmapLens]):
    """Format of COLMAP's list of cameras."""

    name = "colmap"
    title = "COLMAP: cameras.txt"
    suffix = ".txt"
    models = (
        UnifiedCamera, RationalPolynomialCamera, KannalaBrandtCamera, ThinPrismFisheyeCamera,
        DivisionCamera, EucmCamera, EquirectangularCamera,
    )  # fmt: skip
    fits = ((KannalaBrandtCamera, ANY), (EucmCamera, ANY), (UnifiedCamera, base.PINHOLE))
    signature = re.compile(
        r"^[ \t]*\d+[ \t]+[A-Z][A-Z_]+[ \t]+\d+[ \t]+\d+([ \t]+\S+)+[ \t\r]*$"
        r"|CAMERA_ID, MODEL, WIDTH, HEIGHT",
        re.M,
    )
    caveat = "COLMAP's own projection ends at 90°"
    several = True

    def read(self, document: str, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse one camera per line."""
        cameras = []
        for number, line in enumerate(document.splitlines(), start=1):
            cells = line.split()
            if not cells or cells[0].startswith("#"):
                continue
            place = f"{source}: line {number}"
            if len(cells) < 5:
                raise unexpected(place, LINE, line)
            name, model, *numbers = cells
            documents.check_choice(model, MODELS, f"{place}: MODEL")
            width, height = (documents.parse_size(word, place) for word in numbers[:2])
            values = [documents.parse_number(word, place) for word in numbers[2:]]
            values = documents.counted(values, MODELS[model], f"{place}: {model}")
            cameras.append(ParsedCamera(name, _lens(model, (width, height), values, place)))
        if not cameras:
            raise unexpected(source, LINE, "no camera")
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[ColmapLens]]) -> str:
        """Text of a file with one line per camera."""
        text = (
            "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, "
            f"PARAMS[]\n# Number of cameras: {len(cameras)}\n"
        )
        for camera in cameras:
            model, values = parameters(camera.lens)
            size = f"{camera.lens.width_px} {camera.lens.height_px}"
            numbers = " ".join(repr(float(value)) for value in values)
            text += f"{camera.name} {model} {size} {numbers}\n"
        return text

    def camera_name(self, index: int, name: str) -> str:
        """Number, as COLMAP names its cameras."""
        return name if name.isascii() and name.isdecimal() else str(index + 1)


def _lens(model: str, size: tuple[int, int], values: list[float], place: str) -> CentralCamera:
    if model == "EQUIRECTANGULAR":
        if tuple(values) != size:
            raise unexpected(f"{place}: {model}", f"the image's {size[0]} {size[1]}", values)
        return EquirectangularCamera(*size)
    if MODELS[model].startswith("f "):
        values = [values[0], *values]
    fx, fy, cx, cy, *shape = values
    intrinsics = base.Intrinsics(*size, (fx, fy), (cx - CENTER_PX, cy - CENTER_PX))
    four = (*shape, 0.0, 0.0, 0.0, 0.0)[:4]
    with error_context(place):
        if model == "EUCM":
            return EucmCamera(*intrinsics, *shape)
        if model == "FOV":
            return base.FovLens(*intrinsics, *shape)
        if model == "FULL_OPENCV":
            return base.brown_pinhole(intrinsics, shape, place)
        if model == "THIN_PRISM_FISHEYE":
            k1, k2, p1, p2, k3, k4, sx, sy = shape
            if p1 or p2 or sx or sy:
                raise CalibrationError(f"{place}: {model}: expected p1, p2, sx1, sy1 = 0")
            four = k1, k2, k3, k4
        if model == "RAD_TAN_THIN_PRISM_FISHEYE":
            return ThinPrismFisheyeCamera(
                *intrinsics, tuple(shape[:6]), tuple(shape[6:8]), tuple(shape[8:])
            )
        if model.endswith("DIVISION"):
            return DivisionCamera(*intrinsics, *shape)
        if model.endswith("FISHEYE"):
            return KannalaBrandtCamera(*intrinsics, four)
        return base.pinhole(intrinsics, four)


def parameters(lens: ColmapLens) -> tuple[str, tuple[float, ...]]:
    """COLMAP's model name and its parameters."""
    if isinstance(lens, EquirectangularCamera):
        return "EQUIRECTANGULAR", (lens.width_px, lens.height_px)
    u, v = lens.principal_point_px
    start = (*lens.focal_lengths_px, u + CENTER_PX, v + CENTER_PX)
    if isinstance(lens, EucmCamera):
        return "EUCM", (*start, lens.alpha, lens.beta)
    if isinstance(lens, KannalaBrandtCamera):
        return "OPENCV_FISHEYE", (*start, *lens.coefficients)
    if isinstance(lens, ThinPrismFisheyeCamera):
        shape = (*lens.coefficients, *lens.tangential, *lens.prism)
        return "RAD_TAN_THIN_PRISM_FISHEYE", (*start, *shape)
    if isinstance(lens, DivisionCamera):
        return "DIVISION", (*start, lens.k)
    if isinstance(lens, RationalPolynomialCamera):
        return "FULL_OPENCV", (*start, *lens.distortion[:8])
    if lens.k3:
        return "FULL_OPENCV", (*start, *lens.distortion, 0.0, 0.0, 0.0)
    if any(lens.distortion):
        return "OPENCV", (*start, *lens.distortion)
    return "PINHOLE", start
