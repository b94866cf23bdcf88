"""WoodScape's calibration JSON.

    ρ = k1 θ + k2 θ² + k3 θ³ + k4 θ⁴ in pixels
    u = ρ X/χ + cx_offset + width/2 − 0.5,  v = a ρ Y/χ + cy_offset + height/2 − 0.5

a is `aspect_ratio`, 1 in the whole data set. Pixel (0, 0) is the center of the first pixel, as in
omnisim. `extrinsic` maps the camera frame to the vehicle frame (x forward, y left, z up); its
quaternion is x, y, z, w.

Source: the WoodScape repository, calibration and projection example.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from omnisim.cameras import CentralCamera, FThetaCamera
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose, find_pose
from omnisim.cameras.calibration.documents import ForeignTable, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.files.parameters import Number


class _Intrinsic(ForeignTable):
    model: str = "radial_poly"
    poly_order: Number = 4
    aspect_ratio: Number = 1.0
    cx_offset: Number
    cy_offset: Number
    width: documents.Size
    height: documents.Size
    k1: Number
    k2: Number
    k3: Number
    k4: Number


class _Extrinsic(ForeignTable):
    quaternion: documents.Numbers
    translation: documents.Numbers


class _File(ForeignTable, inner={"intrinsic": _Intrinsic, "extrinsic": _Extrinsic}):
    name: str = "camera"
    intrinsic: dict[str, Any]
    extrinsic: dict[str, Any] | None = None


class Woodscape(Format[FThetaCamera]):
    """Format of the WoodScape data set."""

    name = "woodscape"
    title = "WoodScape: calibration json"
    suffix = ".json"
    models = (FThetaCamera,)
    fits = ((FThetaCamera, ANY),)
    signature = re.compile(r'"cx_offset"\s*:|"radial_poly"')
    metadata_place = base.MetadataPlace.KEY
    tables = (_File,)

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        file = parse(document, _File, source)
        place = f"{source}: intrinsic"
        intrinsic = parse(file.intrinsic, _Intrinsic, place)
        name = file.name or "camera"
        poses: tuple[NamedPose, ...] = ()
        if file.extrinsic is not None:
            where = f"{source}: extrinsic"
            extrinsic = parse(file.extrinsic, _Extrinsic, where)
            position = documents.counted(extrinsic.translation, "x y z", f"{where}: translation")
            quaternion = documents.counted(extrinsic.quaternion, "x y z w", f"{where}: quaternion")
            poses = (
                NamedPose("vehicle", name, base.pose_from_quaternion(position, quaternion, where)),
            )
        with error_context(place):
            return [ParsedCamera(name, _lens(intrinsic, place), poses)]

    def encode(self, cameras: Sequence[ParsedCamera[FThetaCamera]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        lens = camera.lens
        k1, k2, k3, k4 = (*lens.coefficients_px, 0.0, 0.0, 0.0)[:4]
        u, v = lens.principal_point_px
        intrinsic = {
            "aspect_ratio": lens.aspect_ratio, "cx_offset": u - (0.5 * lens.width_px - 0.5),
            "cy_offset": v - (0.5 * lens.height_px - 0.5), "height": float(lens.height_px),
            "k1": k1, "k2": k2, "k3": k3, "k4": k4,
            "model": "radial_poly", "poly_order": 4, "width": float(lens.width_px),
        }  # fmt: skip
        data: dict[str, Any] = {"intrinsic": intrinsic, "name": camera.name}
        pose = find_pose(camera.poses, "vehicle", camera.name)
        if pose is not None:
            position, quaternion = base.position_and_quaternion(pose)
            data = {"extrinsic": {"quaternion": quaternion, "translation": position}, **data}
        return json.dumps(data, indent=2) + "\n"

    def unsupported(self, lens: FThetaCamera) -> str | None:
        """Rejects more than four coefficients, and an affine map."""
        if lens.affine != (1.0, 0.0, 0.0):
            return "its f-theta lens has no affine map"
        return "it has four coefficients" if len(lens.coefficients_px) > 4 else None


def _lens(part: _Intrinsic, place: str) -> CentralCamera:
    if part.poly_order != 4:
        raise unexpected(f"{place}: poly_order", "4", part.poly_order)
    documents.check_choice(part.model, ("radial_poly",), f"{place}: model")
    center = part.cx_offset + 0.5 * part.width - 0.5, part.cy_offset + 0.5 * part.height - 0.5
    coefficients = part.k1, part.k2, part.k3, part.k4
    return FThetaCamera(
        part.width, part.height, center, coefficients, aspect_ratio=part.aspect_ratio
    )
