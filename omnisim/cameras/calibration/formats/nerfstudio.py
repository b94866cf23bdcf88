"""Nerfstudio's transforms.json, with intrinsics for all frames or for each frame.

| camera_model | parameters | model |
| --- | --- | --- |
| PINHOLE, OPENCV (k4 = 0) | fl_x fl_y cx cy k1 k2 p1 p2 k3 | perspective, unified |
| OPENCV_FISHEYE, FISHEYE | fl_x fl_y cx cy k1 k2 k3 k4 | kannala_brandt |
| EQUIRECTANGULAR | | equirectangular |

Rays pass through (u + 0.5, v + 0.5): the center of the first pixel is (0.5, 0.5); omnisim's is
(0, 0). `transform_matrix` maps the camera frame to the world. The camera frame has OpenGL's axes (y
up, z back), rotated by half a turn about x from omnisim's. A frame's pose is named
world_from_<its file_path>.

Source: nerfstudio's documentation, "Data conventions"; its module cameras.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.cameras import CentralCamera, EquirectangularCamera, KannalaBrandtCamera, UnifiedCamera
from omnisim.cameras.calibration.calibrated_camera import NamedPose
from omnisim.cameras.calibration.documents import parse_json
from omnisim.cameras.calibration.fields import (
    ForeignTable,
    Matrix,
    Size,
    check_choice,
    parse,
    pose,
    rows,
    unexpected,
)
from omnisim.cameras.calibration.formats.format import (
    ANY,
    PINHOLE,
    Format,
    MetadataPlace,
    ParsedCamera,
    error_context,
)
from omnisim.cameras.calibration.formats.pinhole import Intrinsics, pinhole
from omnisim.core.errors import CalibrationError
from omnisim.core.files.parameters import Number

CENTER_PX = 0.5  # center of the first pixel
OPENGL_FROM_OPENCV = np.array([1.0, -1.0, -1.0, 1.0])
PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "PERSPECTIVE")
FISHEYES = ("OPENCV_FISHEYE", "FISHEYE")
NerfstudioLens = UnifiedCamera | KannalaBrandtCamera | EquirectangularCamera


class _Intrinsics(ForeignTable):
    camera_model: str = "OPENCV"
    fl_x: Number | None = None
    fl_y: Number | None = None
    cx: Number | None = None
    cy: Number | None = None
    w: Size
    h: Size
    k1: Number = 0.0
    k2: Number = 0.0
    k3: Number = 0.0
    k4: Number = 0.0
    p1: Number = 0.0
    p2: Number = 0.0
    camera_angle_x: Number | None = None


class _Frame(ForeignTable):
    file_path: str = ""
    transform_matrix: Matrix | None = None


class _File(ForeignTable):
    frames: tuple[dict[str, Any], ...] = ()


class Nerfstudio(Format[NerfstudioLens]):
    """Format of nerfstudio's data sets."""

    name = "nerfstudio"
    title = "Nerfstudio: transforms.json"
    suffix = ".json"
    models = (UnifiedCamera, KannalaBrandtCamera, EquirectangularCamera)
    fits = ((KannalaBrandtCamera, ANY), (UnifiedCamera, PINHOLE))
    signature = re.compile(r'\A\s*\{.*"(fl_x|camera_angle_x|transform_matrix)"\s*:', re.S)
    metadata_place = MetadataPlace.KEY
    has_names = False

    def read(self, text: str, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse one camera per set of intrinsics, with the poses of its frames."""
        data = parse_json(text, source)
        frames = parse(data, _File, source).frames
        keys = _Intrinsics.model_fields
        shared = {key: data[key] for key in keys if key in data}
        groups: dict[str, tuple[str, dict[str, Any], list[NamedPose]]] = {}
        for index, frame in enumerate(frames or ({},)):
            place = f"{source}: frames.{index}" if frames else source
            own = {key: frame[key] for key in keys if key in frame}
            values = {**shared, **own}
            fields = parse(frame, _Frame, place)
            group = groups.setdefault(repr(values), (place if own else source, values, []))
            if fields.transform_matrix is not None:
                matrix = pose(fields.transform_matrix, f"{place}: transform_matrix")
                name = fields.file_path or f"frame{index}"
                group[2].append(NamedPose("world", name, matrix * OPENGL_FROM_OPENCV))
        cameras = []
        for index, (place, values, poses) in enumerate(groups.values()):
            name = f"camera{index}" if len(groups) > 1 else "camera"
            lens = _lens(parse(values, _Intrinsics, place), place)
            if (
                len(groups) > 1 and len(poses) == 1
            ):  # one camera per image: it takes the image's name
                name = poses[0].source
            cameras.append(ParsedCamera(name, lens, tuple(poses)))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[NerfstudioLens]]) -> str:
        """Text with the camera and one frame for each of its poses in the world."""
        (camera,) = cameras
        frames = [
            {
                "file_path": pose.source,
                "transform_matrix": rows(pose.target_from_source * OPENGL_FROM_OPENCV),
            }
            for pose in camera.poses
            if pose.target == "world"
        ]
        return json.dumps({**intrinsics(camera.lens), "frames": frames}, indent=2) + "\n"


def _lens(part: _Intrinsics, place: str) -> CentralCamera:
    model = part.camera_model
    check_choice(model, (*PINHOLES, *FISHEYES, "EQUIRECTANGULAR"), f"{place}: camera_model")
    if model == "EQUIRECTANGULAR":
        return EquirectangularCamera(part.w, part.h)
    focal = part.fl_x
    if focal is None and part.camera_angle_x is not None:
        if not 0.0 < part.camera_angle_x < math.pi:
            expected = "more than 0 and less than π"
            raise unexpected(f"{place}: camera_angle_x", expected, part.camera_angle_x)
        focal = 0.5 * part.w / math.tan(0.5 * part.camera_angle_x)
    if focal is None:
        raise CalibrationError(f"{place}: fl_x: missing")
    other = focal if part.fl_y is None else part.fl_y
    u = 0.5 * part.w if part.cx is None else part.cx
    v = 0.5 * part.h if part.cy is None else part.cy
    center = u - CENTER_PX, v - CENTER_PX
    intrinsics = Intrinsics(part.w, part.h, (focal, other), center)
    with error_context(place):
        if model in FISHEYES:
            if part.p1 or part.p2:
                raise unexpected(f"{place}: p1, p2", "0 in a fisheye", [part.p1, part.p2])
            return KannalaBrandtCamera(*intrinsics, (part.k1, part.k2, part.k3, part.k4))
        if part.k4:
            raise unexpected(f"{place}: k4", f"0 with camera_model {model}", part.k4)
        four = part.k1, part.k2, part.p1, part.p2
        return pinhole(intrinsics, (*four, part.k3) if part.k3 else four)


def intrinsics(lens: NerfstudioLens) -> dict[str, Any]:
    """Keys that describe a lens's intrinsics."""
    size = {"w": lens.width_px, "h": lens.height_px}
    if isinstance(lens, EquirectangularCamera):
        return {
            "camera_model": "EQUIRECTANGULAR",
            "fl_x": 0.5 * lens.width_px,
            "fl_y": float(lens.height_px),
            "cx": 0.5 * lens.width_px,
            "cy": 0.5 * lens.height_px,
            **size,
        }
    (fx, fy), (u, v) = lens.focal_lengths_px, lens.principal_point_px
    start = {"fl_x": fx, "fl_y": fy, "cx": u + CENTER_PX, "cy": v + CENTER_PX, **size}
    if isinstance(lens, KannalaBrandtCamera):
        named = zip(("k1", "k2", "k3", "k4"), lens.coefficients, strict=True)
        return {"camera_model": "OPENCV_FISHEYE", **start, **dict(named)}
    named = zip(("k1", "k2", "p1", "p2", "k3"), lens.distortion, strict=False)
    model = "OPENCV" if any(lens.distortion) else "PINHOLE"
    return {"camera_model": model, **start, **dict(named)}
