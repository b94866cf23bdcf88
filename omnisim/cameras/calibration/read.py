"""Reading of cameras from a calibration file."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnisim.cameras import CentralCamera, EucmCamera, KannalaBrandtCamera, UnifiedCamera
from omnisim.cameras.calibration.calibrated_camera import (
    CalibratedCamera,
    NamedPose,
    pose_contradiction,
)
from omnisim.cameras.calibration.calibration_formats import detect_format
from omnisim.cameras.calibration.documents import counted, parse_number, pose, read_text
from omnisim.cameras.calibration.fit import Fit, fit_camera
from omnisim.cameras.calibration.formats.format import (
    ANY,
    PINHOLE,
    Fixed,
    ParsedCamera,
    error_context,
)
from omnisim.cameras.calibration.fov_lens import FovLens
from omnisim.cameras.calibration.metadata import CameraMetadata, camera_from_lens, read_metadata
from omnisim.cameras.models.field_of_view import field_notes
from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError

GOOD_PX = 0.05  # below the accuracy of any corner detector
MAX_NEAREST = 0.01  # residual of the nearest model, as a share of the image's shorter side
MAX_CENTER_OFFSET = 0.5  # share of the image size outside it; beyond, center or size is wrong


class CameraFile(NamedTuple):
    """Content of a calibration file: at least one camera, name of the format, and notes."""

    cameras: tuple[CalibratedCamera, ...]
    format: str
    notes: tuple[str, ...]


def read_cameras(
    path: Path, format: str | None, mirrored: bool | None, theta_max_rad: float | None = None
) -> CameraFile:
    """Read a calibration file; format None: detected.

    `mirrored` (the cameras look into mirrors) and `theta_max_rad` (angle from the axis where the
    field of view ends) are taken from the file's metadata if None.

    Raises:
        CalibrationError: the file is invalid; names file, key, actual and expected value.
    """
    text, source = read_text(path), str(path)
    form = detect_format(text, source, format)
    document = form.document(text, source)
    with error_context(source):
        parsed = form.read(document, source)
        notes = form.notices(document, source)
    metadata = read_metadata(text, form.metadata_place, source)
    names = [camera.name for camera in parsed]
    duplicate = next((name for name in names if names.count(name) > 1), None)
    if duplicate is not None:
        raise CalibrationError(f"{path}: expected different names, got two cameras {duplicate!r}")
    if not parsed:
        raise CalibrationError(f"{path}: expected a camera, got none")
    cameras = []
    for camera in parsed:
        one = metadata.get(camera.name, CameraMetadata(camera=camera.name))
        given = {"mirrored": mirrored, "theta_max_rad": theta_max_rad}
        given = {key: value for key, value in given.items() if value is not None}
        one = one.model_copy(update=given)
        cameras.append(_calibrated(camera, one, f"{source}: {camera.name}"))
    contradiction = pose_contradiction([pose for camera in cameras for pose in camera.poses])
    if contradiction is not None:
        notes.append(contradiction)
    return CameraFile(tuple(cameras), form.name, tuple(notes))


def _calibrated(
    parsed: ParsedCamera[CentralCamera], metadata: CameraMetadata, place: str
) -> CalibratedCamera:
    lens, notes = parsed.lens, parsed.notes
    if isinstance(lens, FovLens):
        lens, note = _nearest_model(lens, place)
        notes = (*notes, note)
    with error_context(place):
        camera = camera_from_lens(lens, metadata)
        _check_camera(camera, place)
    poses = metadata.poses(parsed.poses, place)
    notes = (*notes, *field_notes(camera))
    return CalibratedCamera(
        parsed.name, camera, poses, metadata.residuals, notes, lens.model_name, parsed.time_shift_s
    )


def _nearest_model(lens: FovLens, source: str) -> tuple[CentralCamera, str]:
    """Model of omnisim nearest to a lens of another model, and a note about its residuals."""
    place = f"{source}: {lens.model_name}"
    best: Fit[CentralCamera] | None = None
    candidates: tuple[tuple[type[CentralCamera], Fixed], ...] = (
        (UnifiedCamera, ANY), (UnifiedCamera, PINHOLE), (KannalaBrandtCamera, ANY),
        (EucmCamera, ANY),
    )  # fmt: skip
    for model, fixed in candidates:
        try:
            fit = fit_camera(lens, model, fixed=fixed)
        except CalibrationError:
            continue
        if fit.covered > 0.99 and (best is None or fit.residuals.max_px < best.residuals.max_px):
            best = fit
        if best is not None and best.residuals.max_px <= GOOD_PX:
            break
    if best is None:
        raise CalibrationError(f"{place}: no model of omnisim comes near it")
    name, residuals = best.camera.model_name, best.residuals
    if residuals.max_px > MAX_NEAREST * min(lens.width_px, lens.height_px):
        raise CalibrationError(
            f"{place}: the nearest model of omnisim, {name}, is up to {residuals.max_px:.3g} px off"
        )
    return best.camera, (
        f"{lens.model_name} is none of omnisim's models: read as {name}, "
        f"RMS {residuals.rms_px:.2g} px and at most {residuals.max_px:.2g} px off within "
        f"{math.degrees(residuals.theta_max_rad):.1f}°"
    )


def _check_camera(camera: CentralCamera, place: str) -> None:
    """Reject a camera with an empty image, or with an axis far outside it."""
    size = np.array([camera.width_px, camera.height_px], dtype=np.float64)
    center = np.asarray(camera.principal_point_px)
    offset = np.maximum(-0.5 - center, center - (size - 0.5)) / size
    if not offset.max() <= MAX_CENTER_OFFSET:
        u, v = center
        raise CalibrationError(
            f"{place}: center: expected in the image of {size[0]:g} × {size[1]:g} px or near by, "
            f"got ({u:g}, {v:g}): is one of both another image's?"
        )
    steps = np.linspace(0.0, 1.0, 33)
    grid = np.stack(np.meshgrid(*(steps * (side - 1.0) for side in size)), axis=-1)
    # tests the pixel at the center, because even invalid parameters give the center itself
    rays = camera.ray_from_pixel(np.concatenate((grid.reshape(-1, 2), np.rint(center)[None])))
    if not (rays.valid & np.isfinite(rays.directions).all(axis=-1)).any():
        raise CalibrationError(f"{place}: no pixel of this camera sees anything: expected a lens")


# KITTI-360's calibration folder: one file per fisheye camera, and the extrinsics of all cameras.
#
#     calib_cam_to_pose.txt   per line `image_02: ` and a 3 × 4 matrix, camera to IMU
#     image_02.yaml …         the fisheyes, see formats/camodocal.py
#
# The perspective cameras of perspective.txt are not read.
# Source: KITTI-360's documentation, "Calibrations".


EXTRINSICS = "calib_cam_to_pose.txt"
FORMAT = "kitti360"
BODY = "imu"
NUMBERS = " ".join(f"r{row}{column}" for row in "123" for column in "123t")


def read_kitti360_folder(
    folder: Path, mirrored: bool | None, theta_max_rad: float | None = None
) -> tuple[CalibratedCamera, ...]:
    """Read the fisheye cameras of a folder, at least one, with their poses relative to the IMU.

    Raises:
        CalibrationError: the folder does not exist, or a file is invalid.
    """
    path = folder / EXTRINSICS
    if not path.is_file():
        raise CalibrationError(
            f"{folder}: expected a calibration file, or KITTI-360's folder with {EXTRINSICS}, got "
            "another folder"
        )
    cameras = []
    for name, matrix in _extrinsics(path).items():
        file = folder / f"{name}.yaml"
        if file.is_file():
            read = read_cameras(file, FORMAT, mirrored, theta_max_rad)
            (camera,), poses = read.cameras, (NamedPose(BODY, name, matrix),)
            notes = (*read.notes, *camera.notes)
            cameras.append(dataclasses.replace(camera, name=name, poses=poses, notes=notes))
    if not cameras:
        raise CalibrationError(f"{folder}: expected image_02.yaml or image_03.yaml, got neither")
    return tuple(cameras)


def _extrinsics(path: Path) -> dict[str, Floats]:
    """Poses (4, 4) imu_from_camera by camera name."""
    poses = {}
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        name, colon, text = line.partition(":")
        if not line.strip():
            continue
        place = f"{path}:{number}"
        if not colon:
            raise CalibrationError(f"{place}: expected image_00: and 12 numbers, got {line[:40]!r}")
        values = counted([parse_number(word, place) for word in text.split()], NUMBERS, place)
        poses[name.strip()] = pose(np.reshape(values, (3, 4)).tolist(), place)
    return poses
