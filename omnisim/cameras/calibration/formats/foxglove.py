"""Foxglove's CameraCalibration as JSON: ROS's CameraInfo with other names; see `camera_info`.

`kannala_brandt` is ROS's `equidistant`; omnisim has no model for `fisheye62`.

Source: Foxglove's schemas, foxglove.CameraCalibration.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from omnisim.cameras import CentralCamera
from omnisim.cameras.calibration.documents import parse_json
from omnisim.cameras.calibration.fields import ForeignTable, Numbers, Size, parse
from omnisim.cameras.calibration.formats.camera_info import (
    IDENTITY,
    CameraInfo,
    CameraInfoLens,
    camera_info,
)
from omnisim.cameras.calibration.formats.format import MetadataPlace, ParsedCamera


class _Camera(ForeignTable):
    frame_id: str = "camera"
    width: Size
    height: Size
    distortion_model: str
    D: Numbers
    K: Numbers


class Foxglove(CameraInfo):
    """Format of Foxglove's CameraCalibration."""

    name = "foxglove"
    title = "Foxglove: CameraCalibration json"
    suffix = ".json"
    signature = re.compile(r'\A\s*\{.*"distortion_model"\s*:', re.S)
    metadata_place = MetadataPlace.KEY
    distortion_models = ("plumb_bob", "rational_polynomial")
    fisheye_models = ("kannala_brandt",)

    def read(self, text: str, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        fields = parse(parse_json(text, source), _Camera, source)
        size_px = fields.width, fields.height
        lens = self._lens(size_px, fields.distortion_model, fields.K, fields.D, source, ("K", "D"))
        return [ParsedCamera(fields.frame_id or "camera", lens)]

    def encode(self, cameras: Sequence[ParsedCamera[CameraInfoLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        model, d, k, p = camera_info(camera.lens)
        data = {
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
        return json.dumps(data, indent=2) + "\n"
