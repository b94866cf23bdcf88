"""Gyroflow's lens profiles: one lens of a camera in one mode, as JSON.

The lens is OpenCV's fisheye; the center of the first pixel is (0, 0), as in OpenCV. The profile is
of images of `calib_dimension`, which an anamorphic lens has stretched before.

Source: Gyroflow's lens profile format; the repository gyroflow/lens_profiles (CC0).
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from itertools import chain
from typing import Any

from omnisim.cameras import CentralCamera, KannalaBrandtCamera
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.documents import ROLLING_SHUTTER, ForeignTable, Unread, parse
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context

_STRETCH = Unread("the images were stretched by it before they were calibrated", (1, 1.0))


class _Size(ForeignTable):
    w: documents.Size
    h: documents.Size


class _Fisheye(ForeignTable, harmless="RMS_error radial_distortion_limit"):  # it is the fold
    camera_matrix: documents.Matrix
    distortion_coeffs: documents.Numbers


class _File(
    ForeignTable,
    inner={"calib_dimension": _Size, "fisheye_params": _Fisheye},
    unread={
        "frame_readout_time": ROLLING_SHUTTER,
        "input_horizontal_stretch input_vertical_stretch": _STRETCH,
        "digital_lens digital_lens_params": Unread("the camera warps its images once more"),
        "is_superview": Unread("the camera stretches its images"),
        "interpolations": Unread("lenses of other focal lengths"),
        "crop": Unread("the part of the image that was calibrated"),
        "distortion_model distortion_model_id": Unread(
            "another lens model: calibrate with OpenCV's fisheye", ("opencv_fisheye",), True
        ),
        "use_opencv_standard": Unread("its lens is that of calib_params", (), True),
    },
    harmless="name note calibrated_by orig_dimension output_dimension gyro_lpf num_images fps "
    "official asymmetrical use_opencv_fisheye calib_params identifier calibrator_version date "
    "compatible_settings sync_settings frame_readout_direction focal_length crop_factor "
    "global_shutter",
):
    camera_brand: str = ""
    camera_model: str = ""
    lens_model: str = ""
    camera_setting: str = ""
    calib_dimension: _Size
    fisheye_params: _Fisheye


class Gyroflow(Format[KannalaBrandtCamera]):
    """Format of Gyroflow's lens profiles."""

    name = "gyroflow"
    title = "Gyroflow: lens profile json"
    suffix = ".json"
    models = (KannalaBrandtCamera,)
    fits = ((KannalaBrandtCamera, ANY),)
    signature = re.compile(r'"(calib_dimension|fisheye_params)"\s*:')
    metadata_place = base.MetadataPlace.KEY
    tables = (_File,)
    caveat = "OpenCV's own projection ends at 90°"

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        file = parse(document, _File, source)
        size, lens = file.calib_dimension, file.fisheye_params
        rows = list(chain.from_iterable(lens.camera_matrix))
        place = f"{source}: fisheye_params"
        intrinsics, skew_px = base.matrix_intrinsics(
            (size.w, size.h), rows, f"{place}: camera_matrix"
        )
        base.check_no_skew(skew_px, f"{place}: camera_matrix")
        stated = file.camera_brand, file.camera_model, file.lens_model, file.camera_setting
        name = " ".join(filter(None, stated)) or "camera"
        with error_context(place):
            coefficients = lens.distortion_coeffs
            fisheye = base.fisheye(intrinsics, coefficients, f"{place}: distortion_coeffs")
            return [ParsedCamera(name, fisheye)]

    def encode(self, cameras: Sequence[ParsedCamera[KannalaBrandtCamera]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        lens = camera.lens
        (fx, fy), (cx, cy) = lens.focal_lengths_px, lens.principal_point_px
        size = {"w": lens.width_px, "h": lens.height_px}
        data = {
            "name": camera.name, "camera_brand": "", "camera_model": camera.name, "lens_model": "",
            "camera_setting": "", "calib_dimension": size, "orig_dimension": size,
            "fisheye_params": {
                "RMS_error": 0.0, "camera_matrix": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
                "distortion_coeffs": list(lens.coefficients), "radial_distortion_limit": None,
            },
            "num_images": 0, "calibrator_version": "", "date": "",
        }  # fmt: skip
        return json.dumps(data, indent=2) + "\n"
