"""omnisim's own json: every camera's parameters by name, mirrors as mirrors, and poses.

    {"omnisim_calibration": 1, "cameras": [{"name": "cam0", "camera": {"model": …}, "poses": […]}]}

A camera's bare `parameters()`, and the `calibration.json` of a run, are read too. Angles are in
degrees, a pose is `{"target": …, "source": …, "target_from_source": 4 × 4}`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from omnisim.calibration.calibration import Pose
from omnisim.calibration.documents import parse_json
from omnisim.calibration.fields import Foreign, Matrix, parse, pose, rows
from omnisim.calibration.fit import FITTED_MODELS
from omnisim.calibration.formats.format import Format, Remarks, Said, making
from omnisim.cameras import CAMERA_MODELS, CentralCamera, camera_from_parameters
from omnisim.errors import CalibrationError

VERSION = 1


class _Pose(Foreign):
    target: str
    source: str
    target_from_source: Matrix


class _Camera(Foreign):
    name: str = "camera"
    camera: dict[str, Any]
    poses: tuple[dict[str, Any], ...] = ()


class _File(Foreign):
    omnisim_calibration: int = VERSION
    cameras: list[dict[str, Any]]


class _RunFile(Foreign):
    camera: dict[str, Any]
    base_from_optical: Matrix


def _looks_like(text: str) -> bool:
    if not text.lstrip().startswith("{"):
        return False
    bare = r'"model"\s*:\s*"(' + "|".join(CAMERA_MODELS) + r')"'
    return bool(re.search(r'"omnisim_calibration"\s*:', text) or re.search(bare, text))


def _read(text: str, source: str) -> list[Said]:
    data = parse_json(text, source)
    if "cameras" in data or "omnisim_calibration" in data:
        file = parse(data, _File, source)
        if file.omnisim_calibration != VERSION:
            raise CalibrationError(
                f"{source}: omnisim_calibration = {file.omnisim_calibration}: want {VERSION}"
            )
        return [_said(part, f"{source}: cameras.{at}") for at, part in enumerate(file.cameras)]
    if isinstance(data.get("camera"), dict):
        run = parse(data, _RunFile, source)
        matrix = pose(run.base_from_optical, f"{source}: base_from_optical")
        lens = _camera(run.camera, f"{source}: camera")
        return [Said("camera", lens, (Pose("base", "camera", matrix),))]
    return [Said("camera", _camera(data, source))]


def _said(part: dict[str, Any], place: str) -> Said:
    fields = parse(part, _Camera, place)
    poses = []
    for index, one in enumerate(fields.poses):
        where = f"{place}.poses.{index}"
        told = parse(one, _Pose, where)
        matrix = pose(told.target_from_source, f"{where}.target_from_source")
        poses.append(Pose(told.target, told.source, matrix))
    return Said(fields.name or "camera", _camera(fields.camera, f"{place}.camera"), tuple(poses))


def _camera(parameters: dict[str, Any], place: str) -> CentralCamera:
    with making(place):
        camera = camera_from_parameters(parameters)
        unknown = parameters.keys() - camera.parameters().keys() - {"mirrored"}
        if unknown:
            raise CalibrationError(f"{place}: {min(unknown)}: unknown key of a {camera.model_name}")
        return camera


def _write(cameras: Sequence[Said]) -> str:
    told = {
        "omnisim_calibration": VERSION,
        "cameras": [
            {
                "name": camera.name,
                "camera": camera.lens.parameters(),
                "poses": [
                    {
                        "target": pose.target,
                        "source": pose.source,
                        "target_from_source": rows(pose.target_from_source),
                    }
                    for pose in camera.poses
                ],
            }
            for camera in cameras
        ],
    }
    return json.dumps(told, indent=2) + "\n"


OWN = Format(
    "omnisim",
    "omnisim: calibration json",
    ".json",
    _looks_like,
    _read,
    _write,
    tuple(CAMERA_MODELS.values()),
    tuple((CAMERA_MODELS[model], {}) for model in FITTED_MODELS),
    remarks=Remarks.KEY,
    several=True,
    is_own=True,
)
