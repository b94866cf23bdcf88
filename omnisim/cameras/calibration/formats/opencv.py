"""OpenCV's calibrations as cv2.FileStorage writes them: omnidir, fisheye, and pinhole.

| format | matrices | model |
| --- | --- | --- |
| opencv_omnidir | K with skew, D = k1 k2 p1 p2, xi | unified |
| opencv_fisheye | K with skew fx α, D = k1 k2 k3 k4 | kannala_brandt |
| opencv_pinhole | K, D = k1 k2 p1 p2 (k3) | perspective, unified with ξ = 0 |
| | K, D = k1 k2 p1 p2 k3 k4 k5 k6 (s1 s2 s3 s4 (τx τy)) | rational_polynomial |

The matrices are `camera_matrix` and `distortion_coefficients`, or `K` and `D`; the size is
`image_width` and `image_height`, or `image_size`. Pixel (0, 0) is the center of the first pixel, as
in omnisim. Four coefficients without xi fit a fisheye or a pinhole: `fisheye_model`, which OpenCV's
own calibration program writes, or the format's name decides.

Limitations: cv2.fisheye is wrong beyond 90°, and cv2.omnidir silently projects rays beyond the
fold.

Source: OpenCV's modules calib3d and ccalib, and their calibration programs.
"""

from __future__ import annotations

import math
import re
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

from omnisim.cameras import (
    CentralCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.errors import CalibrationError
from omnisim.core.files.parameters import Number

OpencvPinholeLens = UnifiedCamera | RationalPolynomialCamera
MATRIX_KEYS = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K")
DISTORTION_KEYS = (
    "distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "D",
)  # fmt: skip
IS_YAML = re.compile(r"\A\s*%YAML|!!opencv-matrix")
HAS_XI = re.compile(r"^[ \t]*xi[ \t]*:", re.M)
HAS_MATRIX = re.compile(
    rf"^[ \t]*({'|'.join((*MATRIX_KEYS, *DISTORTION_KEYS))})[ \t]*:[ \t]*!!opencv-matrix", re.M
)
IS_FISHEYE = re.compile(r"^[ \t]*fisheye_model[ \t]*:[ \t]*1\b", re.M)
IS_PINHOLE = re.compile(r"^[ \t]*fisheye_model[ \t]*:[ \t]*0\b", re.M)


class _Image(ForeignTable):
    image_width: documents.Size
    image_height: documents.Size


class _Matrix(ForeignTable):
    rows: int
    cols: int
    data: documents.Numbers


class _Xi(ForeignTable):
    xi: Number


OTHER_KIND = "it states another of OpenCV's models than --format"


class _Table(
    ForeignTable,
    also_read=" ".join((*MATRIX_KEYS, *DISTORTION_KEYS, "image_size image_width image_height")),
    unread={
        "xi": Unread("ξ of cv2.omnidir: pass --format opencv_omnidir", is_fault=True),
        "fisheye_model": Unread(OTHER_KIND),
    },
    harmless=(
        "calibration_time nframes nr_of_frames board_width board_height board_size "
        "square_size Board_Width Board_Height Square_Size flags flagValue aspectRatio "
        "avg_reprojection_error Avg_Reprojection_Error per_view_reprojection_errors "
        "Per_View_Reprojection_Errors extrinsic_parameters Extrinsic_Parameters "
        "image_points Image_points grid_points rms fixed_aspectRatio"
    ),
):
    """Keys of all kinds of cameras; the matrices have several names."""


class _OmnidirTable(_Table, also_read="xi"):
    """Keys of `cv2.omnidir`."""


class _FisheyeTable(_Table, unread={"fisheye_model": Unread(OTHER_KIND, (1,))}):
    """Keys of `cv2.fisheye`."""


class _File(NamedTuple):
    """Contents of a file: all its data, and the parts shared by all kinds of cameras."""

    data: dict[str, Any]
    source: str
    intrinsics: base.Intrinsics
    skew_px: float
    coefficients: list[float]
    place: str  # file and key of the coefficients, for messages


class _Opencv(Format[base.LensT]):
    """Base of OpenCV's formats: sizes, K and D."""

    suffix = ".yaml"
    has_names = False

    def looks_like(self, text: str) -> bool:
        """True for YAML of `cv2.FileStorage` with this kind of camera."""
        if not IS_YAML.search(text) or not HAS_MATRIX.search(text):
            return False
        kind = OpencvFisheye if IS_FISHEYE.search(text) else OpencvPinhole
        return type(self) is (OpencvOmnidir if HAS_XI.search(text) else kind)

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        data, size = document, document.get("image_size")
        size = size.get("data") if isinstance(size, dict) else size
        stated: dict[str, Any] = {}
        if isinstance(size, list) and len(size) == 2:
            stated = dict(zip(("image_width", "image_height"), size, strict=True))
        image = parse({**stated, **data}, _Image, source)
        if not stated.items() <= {**stated, **data}.items():
            raise unexpected(f"{source}: image_width, image_height", "image_size", dict(image))
        key, matrix = _matrix(data, MATRIX_KEYS, source)
        size_px = image.image_width, image.image_height
        intrinsics, skew_px = base.matrix_intrinsics(size_px, matrix, f"{source}: {key}")
        if "skew" not in self.unified_terms and not self.fisheye_skew:
            base.check_no_skew(skew_px, f"{source}: {key}")
        key, coefficients = _matrix(data, DISTORTION_KEYS, source)
        file = _File(data, source, intrinsics, skew_px, coefficients, f"{source}: {key}")
        with error_context(source):
            return [ParsedCamera("camera", self._lens(file))]

    @abstractmethod
    def _lens(self, file: _File) -> CentralCamera:
        """Lens in a file."""


class OpencvOmnidir(_Opencv[UnifiedCamera]):
    """Format of `cv2.omnidir`."""

    name = "opencv_omnidir"
    title = "OpenCV: omnidir yaml"
    unified_terms = frozenset({"ξ", "skew"})
    tables = (_OmnidirTable,)
    models = (UnifiedCamera,)
    fits = ((UnifiedCamera, base.NO_SKEW),)

    def _lens(self, file: _File) -> CentralCamera:
        if isinstance(file.data.get("xi"), dict):
            place = f"{file.source}: xi"
            (xi,) = documents.counted(parse(file.data["xi"], _Matrix, place).data, "xi", place)
        else:
            xi = parse(file.data, _Xi, file.source).xi
        four = tuple(documents.counted(file.coefficients, "k1 k2 p1 p2", file.place))
        return UnifiedCamera(*file.intrinsics, xi, four, file.skew_px)

    def encode(self, cameras: Sequence[ParsedCamera[UnifiedCamera]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        lens = camera.lens
        return _encode(lens, lens.distortion, lens.skew_px) + f"xi: {base.yaml_float(lens.xi)}\n"


class OpencvFisheye(_Opencv[KannalaBrandtCamera]):
    """Format of `cv2.fisheye`."""

    name = "opencv_fisheye"
    title = "OpenCV: fisheye yaml"
    tables = (_FisheyeTable,)
    models = (KannalaBrandtCamera,)
    fits = ((KannalaBrandtCamera, ANY),)
    caveat = "cv2.fisheye's own projection is wrong past 90°"
    fisheye_skew = True

    def _lens(self, file: _File) -> CentralCamera:
        return base.fisheye(file.intrinsics, file.coefficients, file.place, file.skew_px)

    def encode(self, cameras: Sequence[ParsedCamera[KannalaBrandtCamera]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        text = _encode(camera.lens, camera.lens.coefficients, camera.lens.skew_px)
        return text + "fisheye_model: 1\n"


class OpencvPinhole(_Opencv[OpencvPinholeLens]):
    """Format of `cv2.calibrateCamera`."""

    name = "opencv_pinhole"
    title = "OpenCV: pinhole yaml"
    unified_terms = frozenset({"k3", "thin prism or tilt"})
    models = (UnifiedCamera, RationalPolynomialCamera)
    fits = ((UnifiedCamera, base.PINHOLE), (RationalPolynomialCamera, ANY))
    max_theta_rad = 0.5 * math.pi
    tables = (_Table,)

    def ambiguity(self, text: str, source: str) -> str | None:
        """Reason for naming the format: four coefficients fit a fisheye and a pinhole camera."""
        key, coefficients = _matrix(documents.parse_yaml(text, source), DISTORTION_KEYS, source)
        if len(coefficients) != 4 or IS_PINHOLE.search(text):
            return None
        return (
            f"{key}: 4 numbers, of a fisheye or of a pinhole camera: pass --format opencv_fisheye "
            "or opencv_pinhole, or say fisheye_model: 1 or 0 in the file"
        )

    def _lens(self, file: _File) -> CentralCamera:
        return base.brown_pinhole(file.intrinsics, file.coefficients, file.place)

    def encode(self, cameras: Sequence[ParsedCamera[OpencvPinholeLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        return _encode(camera.lens, camera.lens.distortion) + "fisheye_model: 0\n"


def _matrix(data: dict[str, Any], keys: Sequence[str], source: str) -> tuple[str, list[float]]:
    stated = [key for key in keys if key in data]
    if not stated:
        raise CalibrationError(f"{source}: {keys[0]}: missing")
    key = stated[0]
    if any(data[other] != data[key] for other in stated):
        raise CalibrationError(f"{source}: {', '.join(stated)}: expected the same numbers in each")
    matrix = parse(data[key], _Matrix, f"{source}: {key}")
    if len(matrix.data) != matrix.rows * matrix.cols:
        size = f"{matrix.rows} × {matrix.cols} numbers"
        raise unexpected(f"{source}: {key}", size, len(matrix.data))
    return key, list(matrix.data)


def _encode(
    lens: OpencvPinholeLens | KannalaBrandtCamera, distortion: Sequence[float], skew_px: float = 0.0
) -> str:
    (fx, fy), (cx, cy) = lens.focal_lengths_px, lens.principal_point_px
    k = [fx, skew_px, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    text = f"%YAML:1.0\n---\nimage_width: {lens.width_px}\nimage_height: {lens.height_px}\n"
    text += base.yaml_matrix("camera_matrix", 3, 3, k, opencv=True)
    count = len(distortion)
    return text + base.yaml_matrix("distortion_coefficients", count, 1, distortion, opencv=True)
