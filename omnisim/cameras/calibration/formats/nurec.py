"""NVIDIA's NuRec: f-theta cameras of a rig in rig_trajectories.json.

| reference_poly | model |
| --- | --- |
| PIXELDIST_TO_ANGLE | f_theta_inverse, `pixeldist_to_angle_poly` |
| ANGLE_TO_PIXELDIST | f_theta, `angle_to_pixeldist_poly` |

Polynomials begin with a constant 0; `linear_cde` is the affine map. Only the reference is read; the
other polynomial is its inverse, approximately, and a note says by how much. `T_sensor_rig` is the
pose of the camera on the rig. Pixel (0, 0) is the center of the first pixel, as in omnisim.

Source: NVIDIA's ncore, FThetaCameraModelParameters; gsplat's f-theta camera.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.cameras import CentralCamera, FThetaCamera, FThetaInverseCamera
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.cameras.lens_polynomials import polyval
from omnisim.core.files.parameters import Number

NurecLens = FThetaInverseCamera | FThetaCamera
TERMS = 6  # of a polynomial, its constant included
REFERENCES = ("PIXELDIST_TO_ANGLE", "ANGLE_TO_PIXELDIST")
NOTED_PX = 0.05  # difference between the polynomials that is worth a note
_WINDSHIELD = Unread("the windshield bends rays before the lens", is_fault=True)


class _Parameters(
    ForeignTable,
    unread={
        "shutter_type": documents.ROLLING_SHUTTER._replace(neutral=("GLOBAL",)),
        "external_distortion_parameters": _WINDSHIELD,
    },
):
    resolution: list[documents.Size]
    principal_point: documents.Numbers
    reference_poly: str
    pixeldist_to_angle_poly: documents.Numbers
    angle_to_pixeldist_poly: documents.Numbers
    max_angle: Number
    linear_cde: tuple[Number, Number, Number] = (1.0, 0.0, 0.0)


class _Model(ForeignTable, inner={"parameters": _Parameters}):
    type: str
    parameters: dict[str, Any]


class _Calibration(
    ForeignTable, inner={"camera_model": _Model}, harmless="sequence_id unique_sensor_idx"
):
    logical_sensor_name: str = ""
    T_sensor_rig: documents.Matrix | None = None
    camera_model: dict[str, Any]


class _Calibrations(ForeignTable, inner={"*": _Calibration}):
    """Calibrations by camera."""

    @classmethod
    def reads(cls, key: str, value: Any) -> bool:
        """True: each key is a camera."""
        return True


class _File(
    ForeignTable,
    inner={"camera_calibrations": _Calibrations},
    harmless="rig_trajectories world_to_nre T_world_base lidar_calibrations",
):
    camera_calibrations: dict[str, dict[str, Any]]


class Nurec(Format[NurecLens]):
    """Format of NuRec's rigs."""

    name = "nurec"
    title = "NVIDIA NuRec: rig_trajectories json"
    suffix = ".json"
    models = (FThetaInverseCamera, FThetaCamera)
    fits = ((FThetaInverseCamera, ANY), (FThetaCamera, ANY))
    signature = re.compile(r'"camera_calibrations"\s*:\s*\{')
    metadata_place = base.MetadataPlace.KEY
    several = True
    tables = (_File,)

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras of the rig."""
        cameras: list[ParsedCamera[CentralCamera]] = []
        for key, entry in parse(document, _File, source).camera_calibrations.items():
            place = f"{source}: camera_calibrations.{key}"
            calibration = parse(entry, _Calibration, place)
            name = calibration.logical_sensor_name or key
            model = parse(calibration.camera_model, _Model, f"{place}.camera_model")
            documents.check_choice(model.type, ("ftheta",), f"{place}.camera_model.type")
            lens, notes = _lens(model.parameters, f"{place}.camera_model.parameters")
            poses: tuple[NamedPose, ...] = ()
            if calibration.T_sensor_rig is not None:
                pose = documents.pose(calibration.T_sensor_rig, f"{place}.T_sensor_rig")
                poses = (NamedPose("rig", name, pose),)
            cameras.append(ParsedCamera(name, lens, poses, notes=notes))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[NurecLens]]) -> str:
        """Text of a file with the cameras."""
        entries = {}
        for camera, pose in zip(cameras, base.body_poses(cameras)[1], strict=True):
            model = {"type": "ftheta", "parameters": _parameters(camera.lens)}
            placed = {} if pose is None else {"T_sensor_rig": documents.rows(pose)}
            entries[camera.name] = {**placed, "camera_model": model}
        return json.dumps({"camera_calibrations": entries}, indent=2) + "\n"

    def unsupported(self, lens: NurecLens) -> str | None:
        """Rejects more than five coefficients."""
        return "it has five coefficients" if len(_reference(lens)) >= TERMS else None


def _reference(lens: NurecLens) -> tuple[float, ...]:
    return lens.coefficients_px if isinstance(lens, FThetaCamera) else lens.coefficients


def _lens(parameters: dict[str, Any], place: str) -> tuple[NurecLens, tuple[str, ...]]:
    fields = parse(parameters, _Parameters, place)
    width, height = documents.counted(fields.resolution, "width height", f"{place}.resolution")
    u, v = documents.counted(fields.principal_point, "u v", f"{place}.principal_point")
    documents.check_choice(fields.reference_poly, REFERENCES, f"{place}.reference_poly")
    inverse = fields.reference_poly == REFERENCES[0]
    name = fields.reference_poly.lower() + "_poly"
    backward, forward = fields.pixeldist_to_angle_poly, fields.angle_to_pixeldist_poly
    constant, *terms = (backward if inverse else forward) or (1.0,)
    if constant != 0.0 or not terms:
        raise unexpected(f"{place}.{name}", "0 and then coefficients", [constant, *terms])
    while len(terms) > 1 and terms[-1] == 0.0:
        terms.pop()
    size, end, affine = (int(width), int(height)), fields.max_angle, fields.linear_cde
    with error_context(place):
        lens: NurecLens
        if inverse:
            lens = FThetaInverseCamera(*size, (u, v), tuple(terms), end, affine)
        else:
            lens = FThetaCamera(*size, (u, v), tuple(terms), end, affine=affine)
    theta = np.linspace(0.0, lens.theta_edge_rad, 33)
    radius = np.linspace(0.0, lens.radius_limits[1], 33)
    approximate = polyval(forward or (0.0,), polyval(backward or (0.0,), radius)) - radius
    off_px = float(np.abs(approximate[theta <= end]).max())
    if off_px <= NOTED_PX:
        return lens, ()
    return lens, (f"the other polynomial is up to {off_px:.2g} px off: {name} is the reference",)


def _parameters(lens: NurecLens) -> dict[str, Any]:
    """Fields of a lens; the polynomial that is not the reference is fitted."""
    matrix = lens.pixels_from_axes
    scale = float(matrix[1, 1])  # into pixels along v
    (c, d), (e, _) = (matrix / scale).tolist()
    theta = np.linspace(0.0, lens.theta_edge_rad, 200)
    rays = np.stack((np.sin(theta), 0.0 * theta, np.cos(theta)), axis=-1)
    offset = lens.pixel_from_ray(rays).positions_px - lens.principal_point_px
    radius = scale * (offset @ np.linalg.inv(matrix).T)[:, 0]
    terms, powers = np.array(_reference(lens)), np.arange(1, TERMS)
    forward, backward, reference = terms * scale, terms, REFERENCES[1]
    if isinstance(lens, FThetaCamera):
        backward = np.asarray(np.linalg.lstsq(radius[:, None] ** powers, theta, rcond=None)[0])
    else:
        reference, backward = REFERENCES[0], terms / scale ** powers[: len(terms)]
        forward = np.asarray(np.linalg.lstsq(theta[:, None] ** powers, radius, rcond=None)[0])
    return {
        "resolution": [lens.width_px, lens.height_px], "shutter_type": "GLOBAL",
        "external_distortion_parameters": None, "principal_point": list(lens.principal_point_px),
        "reference_poly": reference, "max_angle": lens.theta_edge_rad, "linear_cde": [c, d, e],
        "pixeldist_to_angle_poly": [0.0, *backward.tolist()],
        "angle_to_pixeldist_poly": [0.0, *forward.tolist()],
    }  # fmt: skip
