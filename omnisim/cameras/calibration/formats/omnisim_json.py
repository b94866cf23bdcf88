"""omnisim's own JSON: all camera parameters by name, mirrors as mirrors, and poses.

    {"omnisim_calibration": 1, "cameras": [{"name": "cam0", "camera": {"model": …}, "poses": […]}]}

A single camera's `parameters()` and the `calibration.json` of a run can be read too. Angles are in
degrees; a pose is `{"target": …, "source": …, "target_from_source": 4 × 4}`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from omnisim.cameras import CAMERA_MODELS, CentralCamera, camera_from_parameters
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse, unexpected
from omnisim.cameras.calibration.fit import FITTED_MODELS
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.errors import CalibrationError
from omnisim.core.files.parameters import Number

VERSION = 1


class _Pose(ForeignTable):
    target: str
    source: str
    target_from_source: documents.Matrix


class _Camera(ForeignTable, inner={"poses": _Pose}):
    name: str = "camera"
    camera: dict[str, Any]
    poses: tuple[dict[str, Any], ...] = ()
    time_shift_s: Number = 0.0


class _File(ForeignTable, inner={"cameras": _Camera}):
    omnisim_calibration: int = VERSION
    cameras: list[dict[str, Any]]


class _RunFile(
    ForeignTable,
    unread={"polygons": Unread("mesh of the mirror: pass the run's sensor file", ("exact",))},
):
    camera: dict[str, Any]
    base_from_optical: documents.Matrix


class OmnisimJson(Format[CentralCamera]):
    """Format of `calibration.json`."""

    name = "omnisim"
    title = "omnisim: calibration json"
    suffix = ".json"
    models = tuple(CAMERA_MODELS.values())
    fits = tuple((model, ANY) for model in FITTED_MODELS.values())
    signature = re.compile(
        rf'\A\s*\{{.*("omnisim_calibration"\s*:|"model"\s*:\s*"({"|".join(CAMERA_MODELS)})")', re.S
    )
    metadata_place = base.MetadataPlace.KEY
    several = True
    tables = (_File, _RunFile)

    def table_of(self, document: Any) -> type[ForeignTable] | None:
        """Schema of a calibration or a run; None for a camera's bare parameters."""
        if "cameras" in document or "omnisim_calibration" in document:
            return _File
        return _RunFile if isinstance(document.get("camera"), dict) else None

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras of a calibration, a run, or a camera's bare parameters."""
        if self.table_of(document) is _File:
            file = parse(document, _File, source)
            if file.omnisim_calibration != VERSION:
                place = f"{source}: omnisim_calibration"
                raise unexpected(place, str(VERSION), file.omnisim_calibration)
            return [_parsed(part, f"{source}: cameras.{n}") for n, part in enumerate(file.cameras)]
        if self.table_of(document) is _RunFile:
            run = parse(document, _RunFile, source)
            matrix = documents.pose(run.base_from_optical, f"{source}: base_from_optical")
            camera = _camera(run.camera, f"{source}: camera")
            return [ParsedCamera("camera", camera, (NamedPose("base", "camera", matrix),))]
        return [ParsedCamera("camera", _camera(document, source))]

    def encode(self, cameras: Sequence[ParsedCamera[CentralCamera]]) -> str:
        """Text of a file with all parameters and poses."""
        entries = []
        for camera in cameras:
            poses = [
                {"target": pose.target, "source": pose.source,
                 "target_from_source": documents.rows(pose.target_from_source)}
                for pose in camera.poses
            ]  # fmt: skip
            parameters = camera.lens.parameters()
            shift = {"time_shift_s": camera.time_shift_s} if camera.time_shift_s else {}
            entries.append({"name": camera.name, "camera": parameters, "poses": poses, **shift})
        return json.dumps({"omnisim_calibration": VERSION, "cameras": entries}, indent=2) + "\n"

    def native(self, camera: CentralCamera) -> CentralCamera:
        """The camera itself."""
        return camera

    def unsupported(self, lens: CentralCamera) -> None:
        """None, because the format represents every lens."""


def _parsed(part: dict[str, Any], place: str) -> ParsedCamera[CentralCamera]:
    fields = parse(part, _Camera, place)
    poses = []
    for index, entry in enumerate(fields.poses):
        where = f"{place}.poses.{index}"
        stated = parse(entry, _Pose, where)
        matrix = documents.pose(stated.target_from_source, f"{where}.target_from_source")
        poses.append(NamedPose(stated.target, stated.source, matrix))
    camera = _camera(fields.camera, f"{place}.camera")
    return ParsedCamera(fields.name or "camera", camera, tuple(poses), fields.time_shift_s)


def _camera(parameters: dict[str, Any], place: str) -> CentralCamera:
    with error_context(place):
        camera = camera_from_parameters(parameters)
        unknown = parameters.keys() - camera.parameters().keys() - {"mirrored"}
        if unknown:
            raise CalibrationError(f"{place}: {min(unknown)}: unknown key of a {camera.model_name}")
        return camera
