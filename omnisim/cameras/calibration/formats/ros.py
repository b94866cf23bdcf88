"""ROS CameraInfo lenses, in YAML files and in Foxglove's JSON.

| distortion_model | D | model |
| --- | --- | --- |
| plumb_bob | k1 k2 p1 p2 k3 | perspective, unified with ξ = 0 |
| rational_polynomial | k1 k2 p1 p2 k3 k4 k5 k6 | rational_polynomial, or as plumb_bob |
| equidistant (fisheye, kannala_brandt) | k1 k2 k3 k4, skew in K | kannala_brandt |

Pixel (0, 0) is the center of the first pixel, as in omnisim. Rays at or beyond 90° from the axis
have no model: `P` and every rectified image lie in a plane.

camera_info_manager stores a YAML file with `camera_matrix: {rows, cols, data}`; camera_calibration
writes fisheyes with `camera_model: fisheye` in place of a distortion model; `ros2 topic echo`
prints the message itself, with `k`, `d`, and `---` below. RealSense's T265 has five numbers in `d`,
of which librealsense's projection reads four.

Source: sensor_msgs/CameraInfo, image_pipeline/CameraInfo.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

from omnisim.cameras import (
    CentralCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
    ThinPrismFisheyeCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.files.parameters import Number

OTHERS = {"fisheye62": "Foxglove's alone: ROS has equidistant"}
FISHEYE62 = "fisheye62"
T265 = (
    "distortion_model: plumb_bob, but the frame is a fisheye's: early RealSense drivers named the "
    "T265's Kannala-Brandt lens so; if it is one, write equidistant"
)
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
CameraInfoLens = (
    UnifiedCamera | RationalPolynomialCamera | KannalaBrandtCamera | ThinPrismFisheyeCamera
)


class CameraInfoMessage(
    ForeignTable,
    unread={
        "binning_x binning_y": Unread("the camera has the full image size", (1,)),
        "roi": Unread("the camera has the full image size"),
    },
    harmless="timestamp header R",
):
    """sensor_msgs/CameraInfo, or Foxglove's CameraCalibration."""

    frame_id: str = ""
    width: documents.Size
    height: documents.Size
    distortion_model: str
    D: documents.Numbers
    K: documents.Numbers
    P: tuple[Number, ...] = ()


class CameraInfo(Format[CameraInfoLens]):
    """Base of the formats with a CameraInfo: names of Brown's and of the Kannala-Brandt models."""

    models: tuple[type[CameraInfoLens], ...] = (
        UnifiedCamera,
        RationalPolynomialCamera,
        KannalaBrandtCamera,
    )
    fits = (
        (UnifiedCamera, base.PINHOLE),
        (RationalPolynomialCamera, ANY),
        (KannalaBrandtCamera, ANY),
    )
    max_theta_rad = 0.5 * math.pi
    distortion_models: tuple[str, ...]
    fisheye_models: tuple[str, ...]

    def _camera(self, message: Any, source: str) -> ParsedCamera[CentralCamera]:
        """Camera of a message."""
        fields = parse(message, CameraInfoMessage, source)
        size_px = fields.width, fields.height
        lens = self._lens(size_px, fields.distortion_model, fields.K, fields.D, source, ("K", "D"))
        notes = baseline_notes("P", fields.P)
        if fields.distortion_model == "plumb_bob" and "fisheye" in fields.frame_id:
            notes += (T265,)
        return ParsedCamera(fields.frame_id or "camera", lens, notes=notes)

    def _lens(
        self,
        size_px: tuple[int, int],
        model: str,
        matrix: Sequence[float],
        coefficients: Sequence[float],
        source: str,
        keys: tuple[str, str],
    ) -> CentralCamera:
        """Lens from an image size, distortion model, K and D; `keys` name K and D in messages."""
        intrinsics, skew_px = base.matrix_intrinsics(size_px, matrix, f"{source}: {keys[0]}")
        if not (self.fisheye_skew and model in self.fisheye_models):
            base.check_no_skew(skew_px, f"{source}: {keys[0]}")
        expected = (*self.distortion_models, *self.fisheye_models)
        documents.check_choice(model, expected, f"{source}: distortion_model", OTHERS)
        with error_context(source):
            if model == FISHEYE62:
                shape = documents.counted(
                    coefficients, "k0 k1 k2 k3 k4 k5 p0 p1", f"{source}: {keys[1]}"
                )
                return ThinPrismFisheyeCamera(*intrinsics, tuple(shape[:6]), tuple(shape[6:]))
            if model in self.fisheye_models:
                return base.fisheye(intrinsics, coefficients, f"{source}: {keys[1]}", skew_px)
            return base.brown_pinhole(intrinsics, coefficients, f"{source}: {keys[1]}")


def baseline_notes(key: str, projection: Sequence[float]) -> tuple[str, ...]:
    """Note on the baseline in the projection matrix (3 × 4) of a stereo pair's second camera."""
    if len(projection) != 12 or not (projection[3] or projection[7]):
        return ()
    return (f"{key} has the baseline of a stereo pair, which is not read as a pose",)


def camera_info(lens: CameraInfoLens) -> tuple[str, list[float], list[float], list[float]]:
    """Fields of the message for a lens: distortion model in ROS's terms, D, K and P."""
    (fx, fy), (cx, cy) = lens.focal_lengths_px, lens.principal_point_px
    skew_px = lens.skew_px if isinstance(lens, KannalaBrandtCamera) else 0.0
    k = [fx, skew_px, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    if isinstance(lens, KannalaBrandtCamera):
        return "equidistant", list(lens.coefficients), k, p
    if isinstance(lens, ThinPrismFisheyeCamera):
        return FISHEYE62, [*lens.coefficients, *lens.tangential], k, p
    if isinstance(lens, RationalPolynomialCamera):
        return "rational_polynomial", list(lens.distortion[:8]), k, p
    return "plumb_bob", [*lens.distortion[:4], lens.k3], k, p


_MESSAGE = re.compile(r"^[kK][ \t]*:", re.M)


class _Matrix(ForeignTable, harmless="rows cols"):
    data: documents.Numbers


class _Camera(
    ForeignTable,
    inner=dict.fromkeys(("camera_matrix", "distortion_coefficients"), _Matrix),
    harmless="rectification_matrix",  # turns rectified images only
):
    image_width: documents.Size
    image_height: documents.Size
    camera_name: str = "camera"
    camera_model: str = ""
    camera_matrix: _Matrix
    distortion_model: str
    distortion_coefficients: _Matrix
    projection_matrix: _Matrix | None = None


class Ros(CameraInfo):
    """Format of ROS's camera_info_manager."""

    name = "ros"
    title = "ROS: CameraInfo yaml"
    suffix = ".yaml"
    signature = re.compile(
        r"^(distortion_model|projection_matrix|rectification_matrix)[ \t]*:", re.M
    )
    tables = (_Camera, CameraInfoMessage)
    distortion_models = ("plumb_bob", "rational_polynomial")
    fisheye_models = ("equidistant", "fisheye", "kannala_brandt")
    fisheye_skew = True

    def looks_like(self, text: str) -> bool:
        """True for YAML with a camera matrix that is not OpenCV's."""
        return (
            not text.lstrip().startswith("{")
            and "!!opencv-matrix" not in text
            and bool(re.search(r"^(camera_matrix|[kK])[ \t]*:", text, re.M))
            and super().looks_like(text)
        )

    def document(self, text: str, source: str) -> Any:
        """Content of a file, or of the first message that `ros2 topic echo` printed."""
        if not _MESSAGE.search(text):
            return super().document(text, source)
        first = re.split(r"^---[ \t\r]*$", text.lstrip("-\n"), maxsplit=1, flags=re.M)[0]
        message = documents.parse_yaml(first, source)
        header = message.get("header")
        named = {"frame_id": header.get("frame_id")} if isinstance(header, dict) else {}
        return named | {key.upper() if len(key) == 1 else key: message[key] for key in message}

    def table_of(self, document: Any) -> type[ForeignTable]:
        """Schema of a file or of a message."""
        return CameraInfoMessage if "K" in document else _Camera

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        if "K" in document:
            return [self._camera(document, source)]
        is_fisheye = document.get("camera_model") == "fisheye"
        extra = {"distortion_model": "fisheye"} if is_fisheye else {}
        fields = parse({**extra, **document}, _Camera, source)
        documents.check_choice(
            fields.camera_model, ("", "pinhole", "fisheye"), f"{source}: camera_model"
        )
        if is_fisheye and fields.distortion_model not in self.fisheye_models:
            place = f"{source}: distortion_model"
            raise unexpected(place, "a fisheye's, as camera_model", fields.distortion_model)
        keys = ("camera_matrix", "distortion_coefficients")
        size_px, matrix = (fields.image_width, fields.image_height), fields.camera_matrix.data
        model, coefficients = fields.distortion_model, fields.distortion_coefficients.data
        lens = self._lens(size_px, model or "plumb_bob", matrix, coefficients, source, keys)
        projection = fields.projection_matrix.data if fields.projection_matrix else []
        notes = baseline_notes("projection_matrix", projection)
        return [ParsedCamera(fields.camera_name or "camera", lens, notes=notes)]

    def encode(self, cameras: Sequence[ParsedCamera[CameraInfoLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        model, d, k, p = camera_info(camera.lens)
        text = f"image_width: {camera.lens.width_px}\nimage_height: {camera.lens.height_px}\n"
        text += f"camera_name: {json.dumps(camera.name)}\n"
        text += base.yaml_matrix("camera_matrix", 3, 3, k)
        text += f"distortion_model: {model}\n"
        text += base.yaml_matrix("distortion_coefficients", 1, len(d), d)
        text += base.yaml_matrix("rectification_matrix", 3, 3, IDENTITY)
        return text + base.yaml_matrix("projection_matrix", 3, 4, p)
