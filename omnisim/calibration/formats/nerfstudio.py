"""Nerfstudio's transforms.json, for all frames or frame by frame.

| camera_model | parameters | here |
| --- | --- | --- |
| PINHOLE, OPENCV (k4 = 0) | fl_x fl_y cx cy k1 k2 p1 p2 k3 | perspective, unified |
| OPENCV_FISHEYE, FISHEYE | fl_x fl_y cx cy k1 k2 k3 k4 | kannala_brandt |
| EQUIRECTANGULAR | | equirectangular |

Its rays go through (u + 0.5, v + 0.5): the first pixel's centre is at (0.5, 0.5), ours at (0, 0).
`transform_matrix` takes the camera to the world, in OpenGL's axes (y up, z back); ours are turned
half around x. A frame's pose is named world_from_<its file_path>.

Source: nerfstudio's documentation, "Data conventions"; its module cameras.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.calibration.calibration import Pose
from omnisim.calibration.documents import parse_json
from omnisim.calibration.fields import Foreign, Matrix, Size, parse, pose, rows
from omnisim.calibration.formats.format import Format, Remarks, Said, making, nameless
from omnisim.calibration.formats.pinholes import as_pinhole, pinhole
from omnisim.cameras import (
    CentralCamera,
    EquirectangularCamera,
    KannalaBrandtCamera,
    UnifiedCamera,
)
from omnisim.errors import CalibrationError
from omnisim.parameters import Number

CENTRE_PX = 0.5  # of the first pixel
OPENGL_FROM_OPENCV = np.array([1.0, -1.0, -1.0, 1.0])
PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "PERSPECTIVE")
FISHEYES = ("OPENCV_FISHEYE", "FISHEYE")
KEYS = (
    "camera_model", "fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2",
    "camera_angle_x",
)  # fmt: skip


class _Intrinsics(Foreign):
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


class _Frame(Foreign):
    file_path: str = ""
    transform_matrix: Matrix | None = None


class _File(Foreign):
    frames: tuple[dict[str, Any], ...] = ()


def _looks_like(text: str) -> bool:
    is_json = text.lstrip().startswith("{")
    return is_json and bool(re.search(r'"(fl_x|camera_angle_x|transform_matrix)"\s*:', text))


def _read(text: str, source: str) -> list[Said]:
    data = parse_json(text, source)
    frames = parse(data, _File, source).frames
    shared = {key: data[key] for key in KEYS if key in data}
    groups: dict[str, tuple[str, dict[str, Any], list[Pose]]] = {}
    for index, frame in enumerate(frames or ({},)):
        place = f"{source}: frames.{index}" if frames else source
        own = {**shared, **{key: frame[key] for key in KEYS if key in frame}}
        fields = parse(frame, _Frame, place)
        has_own = any(key in frame for key in KEYS)
        group = groups.setdefault(repr(own), (place if has_own else source, own, []))
        if fields.transform_matrix is not None:
            matrix = pose(fields.transform_matrix, f"{place}: transform_matrix")
            name = fields.file_path or f"frame{index}"
            group[2].append(Pose("world", name, matrix * OPENGL_FROM_OPENCV))
    said = []
    for index, (place, own, poses) in enumerate(groups.values()):
        name = f"camera{index}" if len(groups) > 1 else "camera"
        lens, notes = _lens(parse(own, _Intrinsics, place), place)
        if len(groups) > 1 and len(poses) == 1:  # a camera a picture: of the same name
            name = poses[0].source
        said.append(Said(name, lens, tuple(poses), notes))
    return said


def _lens(part: _Intrinsics, place: str) -> tuple[CentralCamera, tuple[str, ...]]:
    size, model = (part.w, part.h), part.camera_model
    if model == "EQUIRECTANGULAR":
        return EquirectangularCamera(*size), ()
    focal = part.fl_x
    if focal is None and part.camera_angle_x is not None:
        if not 0.0 < part.camera_angle_x < math.pi:
            raise CalibrationError(
                f"{place}: camera_angle_x = {part.camera_angle_x:g}: want more than 0, less than π"
            )
        focal = 0.5 * part.w / math.tan(0.5 * part.camera_angle_x)
    if focal is None:
        raise CalibrationError(f"{place}: fl_x: missing")
    other = focal if part.fl_y is None else part.fl_y
    u = 0.5 * part.w if part.cx is None else part.cx
    v = 0.5 * part.h if part.cy is None else part.cy
    centre = u - CENTRE_PX, v - CENTRE_PX
    with making(place):
        if model in FISHEYES:
            if part.p1 or part.p2:
                raise CalibrationError(f"{place}: p1, p2: want 0 in a fisheye: omnisim has none")
            four = part.k1, part.k2, part.k3, part.k4
            return KannalaBrandtCamera(*size, (focal, other), centre, four), ()
        if model in PINHOLES:
            if part.k4:
                raise CalibrationError(
                    f"{place}: k4 = {part.k4:g}: want 0 with camera_model = {model!r}: omnisim has "
                    "no such lens"
                )
            four = part.k1, part.k2, part.p1, part.p2
            brown = (*four, part.k3) if part.k3 else four
            return pinhole(size, (focal, other), centre, brown), ()
    raise CalibrationError(
        f"{place}: camera_model = {model!r}: want one of "
        + ", ".join((*PINHOLES, *FISHEYES, "EQUIRECTANGULAR"))
    )


def _write(cameras: Sequence[Said]) -> str:
    (camera,) = cameras
    frames = [
        {
            "file_path": pose.source,
            "transform_matrix": rows(pose.target_from_source * OPENGL_FROM_OPENCV),
        }
        for pose in camera.poses
        if pose.target == "world"
    ]
    return json.dumps({**_words(camera.lens), "frames": frames}, indent=2) + "\n"


def _words(lens: Any) -> dict[str, Any]:
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
    start = {"fl_x": fx, "fl_y": fy, "cx": u + CENTRE_PX, "cy": v + CENTRE_PX, **size}
    if isinstance(lens, KannalaBrandtCamera):
        named = zip(("k1", "k2", "k3", "k4"), lens.coefficients, strict=True)
        return {"camera_model": "OPENCV_FISHEYE", **start, **dict(named)}
    keys = ("k1", "k2", "p1", "p2", "k3")[: len(lens.distortion)]
    named = zip(keys, lens.distortion, strict=True)
    model = "OPENCV" if any(lens.distortion) else "PINHOLE"
    return {"camera_model": model, **start, **dict(named)}


def _refuse(lens: Any) -> str | None:
    if not isinstance(lens, UnifiedCamera):
        return None
    if not as_pinhole(lens):
        return "it has no ξ"
    return "it has no skew" if lens.skew_px else None


NERFSTUDIO = Format(
    "nerfstudio",
    "Nerfstudio: transforms.json",
    ".json",
    _looks_like,
    _read,
    _write,
    (UnifiedCamera, KannalaBrandtCamera, EquirectangularCamera),
    ((KannalaBrandtCamera, {}), (UnifiedCamera, {"xi": 0.0})),
    _refuse,
    Remarks.KEY,
    rename=nameless,
)
