"""KITTI-360's fisheye YAML, shared with camodocal and VINS.

| model_type | parameters | model |
| --- | --- | --- |
| MEI | xi; k1 k2 p1 p2; gamma1 gamma2 u0 v0 | unified |
| PINHOLE | k1 k2 p1 p2; fx fy cx cy | perspective, unified with ξ = 0 |
| KANNALA_BRANDT | k2 k3 k4 k5 mu mv u0 v0 | kannala_brandt, k1 … k4 |

Pixel (0, 0) is the center of the first pixel, as in omnisim. The format has no poses.

Source: camodocal's camera_models; KITTI-360's documentation, "2D fisheye images".
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.cameras import CentralCamera, KannalaBrandtCamera, UnifiedCamera
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.files.parameters import Number, Table

CamodocalLens = UnifiedCamera | KannalaBrandtCamera


class _Mirror(Table):
    xi: Number


class _Distortion(Table):
    k1: Number
    k2: Number
    p1: Number
    p2: Number


class _Gammas(Table):
    gamma1: Number
    gamma2: Number
    u0: Number
    v0: Number


class _Focal(Table):
    fx: Number
    fy: Number
    cx: Number
    cy: Number


class _KannalaBrandt(Table):
    k2: Number
    k3: Number
    k4: Number
    k5: Number
    mu: Number
    mv: Number
    u0: Number
    v0: Number


class _Head(
    ForeignTable,
    unread={
        "extrinsicRotation extrinsicTranslation body_T_cam0": Unread("pose: a Kalibr chain has it"),
        "td": Unread("time shift: a Kalibr chain has it"),
        "rolling_shutter rolling_shutter_tr": documents.ROLLING_SHUTTER,
        "mirror_parameters": Unread("ξ of a MEI camera, and the model is another", is_fault=True),
        "distortion_parameters": Unread("distortion of another model", is_fault=True),
    },
):
    """Keys of all models, and of VINS's settings."""

    model_type: str
    camera_name: str = "camera"
    image_width: documents.Size
    image_height: documents.Size


class _Mei(_Head):
    mirror_parameters: _Mirror
    distortion_parameters: _Distortion
    projection_parameters: _Gammas


class _Pinhole(_Head):
    distortion_parameters: _Distortion
    projection_parameters: _Focal


class _Fisheye(_Head):
    projection_parameters: _KannalaBrandt


TABLES: dict[Any, type[ForeignTable]] = {
    "MEI": _Mei, "PINHOLE": _Pinhole, "KANNALA_BRANDT": _Fisheye,
}  # fmt: skip


class Camodocal(Format[CamodocalLens]):
    """Format of KITTI-360 and camodocal."""

    name = "kitti360"
    title = "KITTI-360 and camodocal: MEI yaml"
    suffix = ".yaml"
    models = (UnifiedCamera, KannalaBrandtCamera)
    fits = ((UnifiedCamera, base.NO_SKEW), (KannalaBrandtCamera, ANY))
    signature = re.compile(r"""^[ \t]*["']?model_type["']?[ \t]*:""", re.M)
    unified_terms = frozenset({"ξ"})
    tables = (_Mei, _Pinhole, _Fisheye)

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera."""
        data = dict(document)
        if not isinstance(data.get("camera_name", ""), str):  # KITTI-360's is a string, 00 is not
            data["camera_name"] = str(data["camera_name"])
        head = parse(data, _Head, source)
        with error_context(source):
            return [ParsedCamera(head.camera_name or "camera", _lens(head, data, source))]

    def table_of(self, document: Any) -> type[ForeignTable]:
        """Schema of a document by its model."""
        return TABLES.get(document.get("model_type"), _Head)

    def lens_caveats(self, lens: CentralCamera) -> tuple[str, ...]:
        """Note on the tangential distortion, which KITTI-360's own code leaves out."""
        if not (isinstance(lens, UnifiedCamera) and lens.xi and any(lens.distortion[2:4])):
            return ()
        radial = dataclasses.replace(lens, distortion=(*lens.distortion[:2], 0.0, 0.0))
        u, v = (np.linspace(0.0, side - 1.0, 65) for side in (lens.width_px, lens.height_px))
        pixels = np.stack(np.meshgrid(u, v), axis=-1)
        rays = lens.ray_from_pixel(pixels)
        theirs = radial.pixel_from_ray(rays.directions)
        offsets_px = np.linalg.norm(theirs.positions_px - pixels, axis=-1)
        most_px = offsets_px[rays.valid & theirs.valid].max(initial=0.0)
        return (f"KITTI-360's own code leaves out p1 and p2: it is up to {most_px:.2g} px off",)

    def encode(self, cameras: Sequence[ParsedCamera[CamodocalLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        lens = camera.lens
        (fu, fv), (u, v) = lens.focal_lengths_px, lens.principal_point_px
        parts: dict[str, dict[str, float]] = {}
        if isinstance(lens, KannalaBrandtCamera):
            model = "KANNALA_BRANDT"
            named = dict(zip(("k2", "k3", "k4", "k5"), lens.coefficients, strict=True))
            parts["projection_parameters"] = {**named, "mu": fu, "mv": fv, "u0": u, "v0": v}
        else:
            model, keys = "PINHOLE", ("fx", "fy", "cx", "cy")
            if lens.xi:
                model, keys = "MEI", ("gamma1", "gamma2", "u0", "v0")
                parts["mirror_parameters"] = {"xi": lens.xi}
            named = dict(zip(("k1", "k2", "p1", "p2"), lens.distortion, strict=False))
            parts["distortion_parameters"] = named
            parts["projection_parameters"] = dict(zip(keys, (fu, fv, u, v), strict=True))
        text = f"%YAML:1.0\n---\nmodel_type: {model}\ncamera_name: {json.dumps(camera.name)}\n"
        text += f"image_width: {lens.width_px}\nimage_height: {lens.height_px}\n"
        for name, values in parts.items():
            text += f"{name}:\n"
            text += "".join(
                f"   {key}: {base.yaml_float(value)}\n" for key, value in values.items()
            )
        return text


def _lens(head: _Head, data: dict[str, Any], source: str) -> CentralCamera:
    size = head.image_width, head.image_height
    others = {"SCARAMUZZA": "its polynomial is that of OCamCalib: pass calib_results.txt"}
    documents.check_choice(head.model_type, TABLES, f"{source}: model_type", others)
    if head.model_type == "MEI":
        mei = parse(data, _Mei, source)
        plane = mei.projection_parameters
        intrinsics = base.Intrinsics(*size, (plane.gamma1, plane.gamma2), (plane.u0, plane.v0))
        distortion = tuple(dict(mei.distortion_parameters).values())
        return UnifiedCamera(*intrinsics, mei.mirror_parameters.xi, distortion)
    if head.model_type == "PINHOLE":
        flat = parse(data, _Pinhole, source)
        focal = flat.projection_parameters
        intrinsics = base.Intrinsics(*size, (focal.fx, focal.fy), (focal.cx, focal.cy))
        return base.pinhole(intrinsics, tuple(dict(flat.distortion_parameters).values()))
    wide = parse(data, _Fisheye, source).projection_parameters
    intrinsics = base.Intrinsics(*size, (wide.mu, wide.mv), (wide.u0, wide.v0))
    return KannalaBrandtCamera(*intrinsics, (wide.k2, wide.k3, wide.k4, wide.k5))
