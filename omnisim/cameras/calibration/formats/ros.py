"""ROS CameraInfo as camera_info_manager stores it in YAML files; see `camera_info`."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from omnisim.cameras import CentralCamera
from omnisim.cameras.calibration.documents import parse_yaml
from omnisim.cameras.calibration.fields import ForeignTable, Numbers, Size, parse
from omnisim.cameras.calibration.formats.camera_info import (
    IDENTITY,
    CameraInfo,
    CameraInfoLens,
    camera_info,
)
from omnisim.cameras.calibration.formats.format import ParsedCamera
from omnisim.cameras.calibration.formats.yaml_text import yaml_matrix


class _Matrix(ForeignTable):
    data: Numbers


class _Camera(ForeignTable):
    image_width: Size
    image_height: Size
    camera_name: str = "camera"
    camera_matrix: _Matrix
    distortion_model: str
    distortion_coefficients: _Matrix


class Ros(CameraInfo):
    """Format of ROS's camera_info_manager."""

    name = "ros"
    title = "ROS: CameraInfo yaml"
    suffix = ".yaml"
    signature = re.compile(
        r"^(distortion_model|projection_matrix|rectification_matrix)[ \t]*:", re.M
    )
    distortion_models = ("plumb_bob", "rational_polynomial")
    fisheye_models = ("equidistant", "fisheye", "kannala_brandt")

    def looks_like(self, text: str) -> bool:
        """True for YAML with a camera matrix that is not OpenCV's."""
        return (
            not text.lstrip().startswith("{")
            and "!!opencv-matrix" not in text
            and bool(re.search(r"^camera_matrix[ \t]*:", text, re.M))
            and super().looks_like(text)
        )

    def read(self, text: str, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        fields = parse(parse_yaml(text, source), _Camera, source)
        lens = self._lens(
            (fields.image_width, fields.image_height),
            fields.distortion_model or "plumb_bob",
            fields.camera_matrix.data,
            fields.distortion_coefficients.data,
            source,
            ("camera_matrix", "distortion_coefficients"),
        )
        return [ParsedCamera(fields.camera_name or "camera", lens)]

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
