"""Foxglove's CameraCalibration as JSON: ROS's CameraInfo with other names; see `ros.py`.

`kannala_brandt` is ROS's `equidistant`; `fisheye62`, with k0 … k5, p0, p1, is thin_prism_fisheye
without a prism.

Source: Foxglove's schemas, foxglove.CameraCalibration.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from omnisim.cameras import ThinPrismFisheyeCamera
from omnisim.cameras.calibration.calibrated_camera import find_pose
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats import ros
from omnisim.cameras.calibration.formats.format import ParsedCamera


class Foxglove(ros.CameraInfo):
    """Format of Foxglove's CameraCalibration."""

    name = "foxglove"
    title = "Foxglove: CameraCalibration json"
    suffix = ".json"
    signature = re.compile(r'\A\s*\{.*"distortion_model"\s*:', re.S)
    metadata_place = base.MetadataPlace.KEY
    distortion_models = ("plumb_bob", "rational_polynomial")
    fisheye_models = ("kannala_brandt", ros.FISHEYE62)
    models = (*ros.CameraInfo.models, ThinPrismFisheyeCamera)
    tables = (ros.CameraInfoMessage,)

    def unsupported(self, lens: ros.CameraInfoLens) -> str | None:
        """Reason why the format cannot represent a lens of one of its models, or None."""
        if isinstance(lens, ThinPrismFisheyeCamera) and any(lens.prism):
            return "it has no thin prism"
        return super().unsupported(lens)

    def encode(self, cameras: Sequence[ParsedCamera[ros.CameraInfoLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        pose = find_pose(camera.poses, ros.RECTIFIED, camera.name)
        model, d, k, r, p = ros.camera_info(camera.lens, pose)
        data = {
            "timestamp": {"sec": 0, "nsec": 0}, "frame_id": camera.name,
            "width": camera.lens.width_px, "height": camera.lens.height_px,
            "distortion_model": "kannala_brandt" if model == "equidistant" else model, "D": d,
            "K": k, "R": r, "P": p,
        }  # fmt: skip
        return json.dumps(data, indent=2) + "\n"
