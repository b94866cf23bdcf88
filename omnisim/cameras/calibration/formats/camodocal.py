"""KITTI-360's fisheye YAML, shared with camodocal and VINS.

| model_type | parameters | model |
| --- | --- | --- |
| MEI | xi; k1 k2 p1 p2; gamma1 gamma2 u0 v0 | unified |
| PINHOLE | k1 k2 p1 p2; fx fy cx cy | perspective, unified with ξ = 0 |
| KANNALA_BRANDT | k2 k3 k4 k5 mu mv u0 v0 | kannala_brandt, k1 … k4 |

Pixel (0, 0) is the center of the first pixel, as in omnisim. The format has no poses, but VINS's
settings have them, read only: `extrinsicRotation` and `extrinsicTranslation`, or `body_T_cam0`, map
the camera's frame to the IMU's, and a camera timestamp plus `td` is IMU time. VINS-Fusion's
settings name a file for each camera: `cam0_calib`, `cam1_calib`.

Source: camodocal's camera_models; KITTI-360's documentation, "2D fisheye images"; VINS-Fusion's
parameters.cpp.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pydantic

from omnisim.cameras import CentralCamera, KannalaBrandtCamera, UnifiedCamera
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose
from omnisim.cameras.calibration.documents import ForeignTable, MatrixTable, Unread, parse
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.files.parameters import Number, Table

CamodocalLens = UnifiedCamera | KannalaBrandtCamera


# Parts of each model, and the keys of their numbers in the order of the model's parameters.
PARTS = {
    "MEI": {
        "mirror_parameters": "xi", "distortion_parameters": "k1 k2 p1 p2",
        "projection_parameters": "gamma1 gamma2 u0 v0",
    },
    "PINHOLE": {
        "distortion_parameters": "k1 k2 p1 p2", "projection_parameters": "fx fy cx cy",
    },
    "KANNALA_BRANDT": {"projection_parameters": "k2 k3 k4 k5 mu mv u0 v0"},
}  # fmt: skip


class _Head(
    ForeignTable,
    inner=dict.fromkeys(("body_T_cam0", "extrinsicRotation", "extrinsicTranslation"), MatrixTable),
    unread={
        "rolling_shutter rolling_shutter_tr": documents.ROLLING_SHUTTER,
        "mirror_parameters": Unread("ξ of a MEI camera, but the model is another", is_fault=True),
        "distortion_parameters": Unread("distortion of another model", is_fault=True),
    },
):
    """Keys of all models, and of VINS's settings."""

    model_type: str
    camera_name: str = "camera"
    image_width: documents.Size
    image_height: documents.Size
    body_T_cam0: MatrixTable | None = None
    extrinsicRotation: MatrixTable | None = None
    extrinsicTranslation: MatrixTable | None = None
    td: Number = 0.0


def _table(model: str) -> type[_Head]:
    """Schema of a model's file."""
    parts: dict[str, Any] = {}
    for part, keys in PARTS[model].items():
        numbers: dict[str, Any] = {key: (Number, ...) for key in keys.split()}
        parts[part] = (pydantic.create_model(part, __base__=Table, **numbers), ...)
    return pydantic.create_model(model, __base__=_Head, **parts)


TABLES = {model: _table(model) for model in PARTS}


class Camodocal(Format[CamodocalLens]):
    """Format of KITTI-360 and camodocal."""

    name = "kitti360"
    title = "KITTI-360, camodocal and VINS: MEI yaml"
    suffix = ".yaml"
    models = (UnifiedCamera, KannalaBrandtCamera)
    fits = ((UnifiedCamera, base.NO_SKEW), (KannalaBrandtCamera, ANY))
    signature = re.compile(r"""^[ \t]*["']?(model_type|cam0_calib)["']?[ \t]*:""", re.M)
    unified_terms = frozenset({"ξ"})
    tables = tuple(TABLES.values())

    def document(self, text: str, source: str) -> Any:
        """Content of a file; cam0, … with those of VINS-Fusion's cameras, if it names them."""
        data = super().document(text, source)
        if "cam0_calib" not in data:
            return data
        cameras = documents.Joined()
        for index in range(2 if data.get("num_of_cam") == 2 else 1):
            name = f"cam{index}"
            if not isinstance(file := data.get(f"{name}_calib"), str):
                raise documents.unexpected(f"{source}: {name}_calib", "the name of a file", file)
            camera_text, path = documents.read_beside(source, f"{name}_calib", file)
            camera = super().document(camera_text, str(path))
            stated = {"td": data.get("td"), "body_T_cam0": data.get(f"body_T_{name}")}
            stated = {key: value for key, value in stated.items() if value is not None}
            cameras[name] = {**camera, **stated, "camera_name": name}
        return cameras

    def camera(self, document: Any, source: str) -> ParsedCamera[CentralCamera]:
        """Parse a camera."""
        data = dict(document)
        if not isinstance(data.get("camera_name", ""), str):  # KITTI-360's is a string, 00 is not
            data["camera_name"] = str(data["camera_name"])
        head = parse(data, _Head, source)
        name, poses = head.camera_name or "camera", list[NamedPose]()
        if head.body_T_cam0 is not None:
            matrix = documents.flat_pose(head.body_T_cam0.data, f"{source}: body_T_cam0")
            poses.append(NamedPose("imu", name, matrix))
        rotation, position = head.extrinsicRotation, head.extrinsicTranslation
        if rotation is not None or position is not None:
            place = f"{source}: extrinsicRotation, extrinsicTranslation"
            r, xyz = (part.data if part else [] for part in (rotation, position))
            poses.append(NamedPose("imu", name, documents.pose_of(r, xyz, place)))
        with error_context(source):
            return ParsedCamera(name, _lens(head, data, source), tuple(poses), head.td)

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
        ends = (*lens.focal_lengths_px, *lens.principal_point_px)
        numbers: dict[str, tuple[float, ...]] = {"projection_parameters": ends}
        if isinstance(lens, KannalaBrandtCamera):
            model = "KANNALA_BRANDT"
            numbers["projection_parameters"] = (*lens.coefficients, *ends)
        else:
            model = "MEI" if lens.xi else "PINHOLE"
            numbers |= {"mirror_parameters": (lens.xi,), "distortion_parameters": lens.distortion}
        text = f"%YAML:1.0\n---\nmodel_type: {model}\ncamera_name: {json.dumps(camera.name)}\n"
        text += f"image_width: {lens.width_px}\nimage_height: {lens.height_px}\n"
        for part, keys in PARTS[model].items():
            text += f"{part}:\n"
            for key, value in zip(keys.split(), numbers[part], strict=False):
                text += f"   {key}: {base.yaml_float(value)}\n"
        return text


def _lens(head: _Head, data: dict[str, Any], source: str) -> CentralCamera:
    size = head.image_width, head.image_height
    others = {"SCARAMUZZA": "its polynomial is that of OCamCalib: pass calib_results.txt"}
    documents.check_choice(head.model_type, TABLES, f"{source}: model_type", others)
    table = parse(data, TABLES[head.model_type], source)
    numbers = {part: tuple(dict(getattr(table, part)).values()) for part in PARTS[head.model_type]}
    *shape, fu, fv, u, v = numbers["projection_parameters"]
    intrinsics = base.Intrinsics(*size, (fu, fv), (u, v))
    if head.model_type == "KANNALA_BRANDT":
        return KannalaBrandtCamera(*intrinsics, tuple(shape))
    if head.model_type == "MEI":
        (xi,) = numbers["mirror_parameters"]
        return UnifiedCamera(*intrinsics, xi, numbers["distortion_parameters"])
    return base.pinhole(intrinsics, numbers["distortion_parameters"])
