"""ROS CameraInfo in YAML; see `camera_info`.

camera_info_manager stores it with `camera_matrix: {rows, cols, data}`; camera_calibration writes
fisheyes with `camera_model: fisheye` in place of a distortion model; `ros2 topic echo` prints the
message itself, with `k`, `d`, and `---` below.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from omnisim.cameras import CentralCamera
from omnisim.cameras.calibration.documents import parse_yaml
from omnisim.cameras.calibration.fields import (
    ForeignTable,
    Numbers,
    Size,
    check_choice,
    parse,
    unexpected,
)
from omnisim.cameras.calibration.formats.camera_info import (
    IDENTITY,
    CameraInfo,
    CameraInfoLens,
    CameraInfoMessage,
    baseline_notes,
    camera_info,
)
from omnisim.cameras.calibration.formats.format import ParsedCamera
from omnisim.cameras.calibration.formats.yaml_text import yaml_matrix

_MESSAGE = re.compile(r"^[kK][ \t]*:", re.M)


class _Matrix(ForeignTable, harmless="rows cols"):
    data: Numbers


class _Camera(
    ForeignTable,
    inner=dict.fromkeys(("camera_matrix", "distortion_coefficients"), _Matrix),
    harmless="rectification_matrix",  # turns rectified images only
):
    image_width: Size
    image_height: Size
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
        message = parse_yaml(first, source)
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
        check_choice(fields.camera_model, ("", "pinhole", "fisheye"), f"{source}: camera_model")
        if is_fisheye and fields.distortion_model not in self.fisheye_models:
            place = f"{source}: distortion_model"
            raise unexpected(place, "a fisheye's, as camera_model", fields.distortion_model)
        lens = self._lens(
            (fields.image_width, fields.image_height),
            fields.distortion_model or "plumb_bob",
            fields.camera_matrix.data,
            fields.distortion_coefficients.data,
            source,
            ("camera_matrix", "distortion_coefficients"),
        )
        projection = fields.projection_matrix.data if fields.projection_matrix else []
        notes = baseline_notes("projection_matrix", projection)
        return [ParsedCamera(fields.camera_name or "camera", lens, notes=notes)]

    def encode(self, cameras: Sequence[ParsedCamera[CameraInfoLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        model, d, k, p = camera_info(camera.lens)
        text = f"image_width: {camera.lens.width_px}\nimage_height: {camera.lens.height_px}\n"
        text += f"camera_name: {json.dumps(camera.name)}\n"
        text += yaml_matrix("camera_matrix", 3, 3, k)
        text += f"distortion_model: {model}\n"
        text += yaml_matrix("distortion_coefficients", 1, len(d), d)
        text += yaml_matrix("rectification_matrix", 3, 3, IDENTITY)
        return text + yaml_matrix("projection_matrix", 3, 4, p)
