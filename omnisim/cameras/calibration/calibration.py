"""Calibrations: the cameras of a calibration file, read and written."""

from __future__ import annotations

import dataclasses
import math
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from omnisim.cameras import (
    CameraSensor,
    CentralCamera,
    EucmCamera,
    KannalaBrandtCamera,
    MirroredCamera,
    OcamcalibCamera,
    RadialTableCamera,
    RationalPolynomialCamera,
    ThinPrismFisheyeCamera,
    UnifiedCamera,
    summary,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import (
    WORLD,
    CalibratedCamera,
    NamedPose,
    find_pose,
    pose_contradiction,
)
from omnisim.cameras.calibration.calibration_formats import detect_format, format_named, tool_of
from omnisim.cameras.calibration.encode import encode_cameras
from omnisim.cameras.calibration.fit import Fit, fit_camera
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import error_context
from omnisim.cameras.calibration.formats.ros import with_poses
from omnisim.cameras.calibration.metadata import CameraMetadata, camera_from_lens, read_metadata
from omnisim.cameras.catalog.lens_catalog import PREFIX, find
from omnisim.cameras.models.field_of_view import field_notes
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError, NoticeWarning, OutputError, did_you_mean
from omnisim.core.files.atomic_file import atomic_write, check_target
from omnisim.core.short_repr import short_repr

# Other common suffixes for the same text.
_ALSO = {".yaml": (".yml",), ".sdf": (".xml", ".world", ".urdf")}


@dataclass(frozen=True, eq=False)
class Calibration:
    """Cameras of a calibration file, in file order.

    Attributes:
        cameras: cameras of the file, at least one, with distinct names.
        format, source: names of the file format, and of the file, for messages.
        file_notes: notes on the whole file, one sentence each.
        tool: name of the tool that the file is from; empty if unknown.
    """

    cameras: tuple[CalibratedCamera, ...]
    format: str = "omnisim"
    source: str = "calibration"
    file_notes: tuple[str, ...] = ()
    tool: str = ""

    def __repr__(self) -> str:
        cameras = [f"{camera.name}: {summary(camera.camera)}" for camera in self.cameras]
        return short_repr(self, repr(self.source), self.format, *cameras)

    @property
    def names(self) -> list[str]:
        """Names of the cameras."""
        return [camera.name for camera in self.cameras]

    @property
    def notes(self) -> list[str]:
        """Notes on the file and all cameras for the user, one sentence each."""
        several = len(self.cameras) > 1
        return [*self.file_notes] + [
            f"{camera.name}: {note}" if several else note
            for camera in self.cameras
            for note in camera.notes
        ]

    def camera(self, name: str | None = None) -> CalibratedCamera:
        """Camera with the given name; by default the first.

        Raises:
            CalibrationError: the file has no such camera.
        """
        if name is None:
            return self.cameras[0]
        for camera in self.cameras:
            if camera.name == name:
                return camera
        names = ", ".join(self.names)
        raise CalibrationError(f"{self.source}: camera: expected one of {names}, got {name!r}")

    def only_camera(self) -> CalibratedCamera:
        """The only camera of the calibration.

        Raises:
            CalibrationError: there are several cameras.
        """
        if len(self.cameras) > 1:
            raise CalibrationError(
                f"{self.source}: expected one camera, got {', '.join(self.names)}: "
                "select one with calibration.camera(name)"
            )
        return self.cameras[0]

    def only(self, name: str) -> Calibration:
        """Calibration reduced to one camera, as `camera` finds it."""
        return dataclasses.replace(self, cameras=(self.camera(name),))

    def save(self, path: str | Path, format: str, model: str | None = None) -> Calibration:
        """Write a calibration file; see `save_calibration`.

        Raises:
            CalibrationError: the format cannot hold one of the cameras; states the reason.
            OutputError: the file cannot be written.
        """
        return save_calibration(self, path, format, model)


def calibration_of(camera: CentralCamera | CameraSensor, name: str = "cam0") -> Calibration:
    """Wrap a camera model, or a renderer's sensor, as a calibration that can be saved.

    Raises:
        CalibrationError: `camera` is neither.
    """
    model = camera.model if isinstance(camera, CameraSensor) else camera
    if not isinstance(model, CentralCamera):
        kind = type(camera).__name__
        raise CalibrationError(f"calibration: expected a camera model or a sensor, got {kind}")
    return Calibration((CalibratedCamera(name, model),))


def load_calibration(
    path: str | Path,
    format: str | None = None,
    camera: str | None = None,
    mirrored: bool | None = None,
    theta_max_deg: float | None = None,
) -> Calibration:
    """Read a calibration file; its notes are also issued as `NoticeWarning`.

    Args:
        path: calibration file, a folder with those of a rig (KITTI-360's, EuRoC's, Kimera's, or
            left.yaml and right.yaml of ROS), rays per pixel (EXR or CSV, read as the nearest
            model), or `catalog:` and the name of an entry of
            `omnisim.cameras.catalog`.
        format: name of the format, one of `FORMATS`; by default detected from the content.
        camera: name of the only camera to keep; by default all are kept.
        mirrored: True if the cameras look into mirrors; by default taken from omnisim's metadata in
            the file, and False without metadata.
        theta_max_deg: angle from the axis where the field of view ends; by default where the model
            ends.

    Raises:
        CalibrationError: the file is invalid; names file, key, actual and expected value.
    """
    path, limit_rad = Path(path), None
    if theta_max_deg is not None:
        if type(theta_max_deg) not in (int, float) or not 0.0 < theta_max_deg <= 180.0:
            got = repr(theta_max_deg)
            raise CalibrationError(f"theta_max_deg: expected a number, 0 to 180, got {got}")
        limit_rad = math.radians(theta_max_deg)
    try:
        is_folder = path.is_dir()
    except OSError as reason:  # the name is too long
        raise CalibrationError(f"{path}: cannot be read: {reason.strerror}") from None
    if str(path).startswith(PREFIX):
        if format is not None or mirrored:
            raise CalibrationError(
                f"{path}: format, mirrored: expected none with a camera of the catalog"
            )
        entry = find(str(path))
        lens = entry.lens if limit_rad is None else entry.lens.ending_at(limit_rad) or entry.lens
        notes = (*entry.notes, *field_notes(lens))
        camera_of_entry = CalibratedCamera(entry.title, lens, notes=notes)
        name = f"{PREFIX}{entry.name}"
        calibration = Calibration((camera_of_entry,), "catalog", name, tool="Gyroflow")
    elif is_folder:
        calibration = read_folder(path, format, mirrored, limit_rad)
    elif path.suffix.lower() in (".exr", ".csv") and format is None:
        calibration = _read_table(path, limit_rad)
    else:
        calibration = read_cameras(path, format, mirrored, limit_rad)
    selected = calibration if camera is None else calibration.only(camera)
    for model in (calibrated.camera for calibrated in selected.cameras):
        if limit_rad not in (None, math.pi) and model.domain_limit_rad is None:
            raise CalibrationError(
                f"theta_max_deg: {model.model_name} has a limit of its own, from its parameters: "
                "`omnisim calibration convert` to opencv_fisheye fits a lens with this key"
            )
    for note in selected.notes:
        warnings.warn(f"{path}: {note}", NoticeWarning, stacklevel=2)
    return selected


def save_calibration(
    calibration: Calibration, path: str | Path, format: str, model: str | None = None
) -> Calibration:
    """Write a calibration file, and return the cameras as written.

    Args:
        calibration: cameras to write; a single-camera format accepts only one.
        path: output file.
        format: name of the format, one of `FORMATS`.
        model: name of the model to write; by default a model that represents the lens exactly, else
            the one whose maximum residual is smallest.

    Raises:
        CalibrationError: the format cannot hold one of the cameras; states the reason.
        OutputError: the file cannot be written, or its suffix belongs to another kind of file.
    """
    path = Path(path)
    check_calibration_suffix(path, format)
    check_target(path)
    text, written = calibration_text(calibration, format, model)
    with atomic_write(path) as partial:
        try:
            partial.write_text(text, encoding="utf-8")
        except OSError as reason:
            raise OutputError(f"{path}: cannot be written: {reason.strerror}") from None
    return written


def check_calibration_suffix(path: Path, format: str) -> None:
    """Reject a file suffix that does not match the format.

    Raises:
        CalibrationError: the format is unknown.
        OutputError: the suffix belongs to another format; a name without a suffix passes.
    """
    form = format_named(format)
    known = (form.suffix, *_ALSO.get(form.suffix, ()))
    if path.suffix and path.suffix.lower() not in known:
        names = " or ".join(known)
        raise OutputError(f"{path}: expected {names} for {form.name}, got {path.suffix}")


def calibration_text(
    calibration: Calibration, format: str, model: str | None = None
) -> tuple[str, Calibration]:
    """Text of a calibration file, and the cameras as written.

    Raises:
        CalibrationError: the format cannot hold one of the cameras; states the reason.
    """
    form = format_named(format)
    if len(calibration.cameras) > 1 and not form.several:
        raise CalibrationError(
            f"{calibration.source}: {len(calibration.cameras)} cameras, and a {form.name} file "
            "holds one: pass --camera-name with one of " + ", ".join(calibration.names)
        )
    text, written = encode_cameras(calibration.cameras, form, model, calibration.source)
    return text, Calibration(written, form.name, calibration.source)


# Camera rigs: the cameras of a calibration on the body that carries them.
#
# A calibration gives poses in pairs: a camera relative to the previous one, or to the IMU. The rig
# chains them to poses on one body. The body is the frame that the file names beside its cameras
# (`imu`, `vehicle`, `base`), or the first camera if there is none. A pose in the world is not a
# mounting.


@dataclass(frozen=True, eq=False)
class RigCamera:
    """Camera on a rig, by its name in the file."""

    name: str
    model: CentralCamera
    # (4, 4) pose of its optical frame (x right, y down, z forward)
    body_from_camera: Floats
    time_shift_s: float = 0.0  # offset from camera timestamps to IMU timestamps

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), summary(self.model))


@dataclass(frozen=True, eq=False)
class Rig:
    """Cameras on one body, at least one, in file order."""

    body: str  # name of the body frame: a frame other than the cameras', or the first camera
    cameras: tuple[RigCamera, ...]

    def __repr__(self) -> str:
        return short_repr(self, f"on {self.body}", *(camera.name for camera in self.cameras))

    @property
    def has_body(self) -> bool:
        """True if the body is not one of the cameras."""
        return self.body not in [camera.name for camera in self.cameras]

    def only(self, name: str) -> Rig:
        """Rig with only one of the cameras, on the same body.

        Raises:
            CalibrationError: there is no camera of that name.
        """
        names = [camera.name for camera in self.cameras]
        if name not in names:
            raise CalibrationError(f"camera {name!r}: {did_you_mean(name, names)}")
        return Rig(self.body, (self.cameras[names.index(name)],))

    @classmethod
    def of(cls, calibration: Calibration, name: str | None = None) -> Rig:
        """Build a rig from the cameras of a calibration.

        With a name, only that camera is required. The other cameras may then lack extrinsics; if
        the named camera lacks them too, it becomes a rig of its own.

        Raises:
            CalibrationError: the file lacks a camera's pose on the body, or two chains of poses
                contradict each other.
        """
        names = calibration.names
        poses = [
            pose
            for camera in calibration.cameras
            for pose in camera.poses
            if WORLD not in (pose.target, pose.source)
        ]
        contradiction = pose_contradiction(poses)
        if contradiction is not None:
            raise CalibrationError(f"{calibration.source}: {contradiction}")
        frames = [frame for pose in poses for frame in (pose.target, pose.source)]
        body = next((frame for frame in frames if frame not in names), names[0])
        cameras = []
        for camera in calibration.cameras:
            pose = find_pose(poses, body, camera.name)
            if pose is not None:
                cameras.append(RigCamera(camera.name, camera.camera, pose, camera.time_shift_s))
            elif name is None:
                raise CalibrationError(
                    f"{calibration.source}: {camera.name}: expected its pose from {body}, got no "
                    "extrinsics: --camera-name selects one camera"
                )
            elif name == camera.name:
                return cls.of(calibration.only(name))
        if name is not None:
            calibration.camera(name)  # raises if it does not exist
        return cls(body, tuple(cameras))


# Reading of cameras: lenses that omnisim has no model for become the nearest one.


GOOD_PX = 0.05  # below the accuracy of any corner detector
MAX_NEAREST = 0.01  # residual of the nearest model, as a share of the image's shorter side
# OpenVINS's estimator_config.yaml names the chain beside it
_OPENVINS_CHAIN = re.compile(r"""^relative_config_imucam[ \t]*:[ \t]*["']?([^"'\s]+)""", re.M)
MAX_CENTER_OFFSET = 0.5  # share of the image size outside it; beyond, center or size is wrong


def read_cameras(
    path: Path, format: str | None, mirrored: bool | None, theta_max_rad: float | None = None
) -> Calibration:
    """Read a calibration file; format None: detected.

    `mirrored` (the cameras look into mirrors) and `theta_max_rad` (angle from the axis where the
    field of view ends) are taken from the file's metadata if None.

    Raises:
        CalibrationError: the file is invalid; names file, key, actual and expected value.
    """
    text = documents.read_text(path)
    chain = _OPENVINS_CHAIN.search(text)
    if chain is not None and format in (None, "kalibr"):
        text, path = documents.read_beside(str(path), "relative_config_imucam", chain[1])
    source = str(path)
    form = detect_format(text, source, format)
    document = form.document(text, source)
    with error_context(source):
        parsed = form.read(document, source)
        notes = form.notices(document, source)
    metadata = read_metadata(text, form.metadata_place, source)
    _check_names([camera.name for camera in parsed], path)
    if not parsed:
        raise CalibrationError(f"{path}: expected a camera, got none")
    given = {"mirrored": mirrored, "theta_max_rad": theta_max_rad}
    given = {key: value for key, value in given.items() if value is not None}
    cameras = []
    for entry in parsed:
        own = metadata.get(entry.name, CameraMetadata(camera=entry.name)).model_copy(update=given)
        place, lens, own_notes = f"{source}: {entry.name}", entry.lens, entry.notes
        if isinstance(lens, base.ForeignLens):
            lens, note = _nearest_model(lens, place, lens.nearest_models)
            own_notes = (*own_notes, note)
        with error_context(place):
            camera = camera_from_lens(lens, own)
            _check_camera(camera, place)
        poses = own.poses(entry.poses, place)
        own_notes = (*own_notes, *field_notes(camera))
        calibrated = (camera, poses, own.residuals, own_notes, lens.model_name, entry.time_shift_s)
        cameras.append(CalibratedCamera(entry.name, *calibrated))
    contradiction = pose_contradiction([pose for camera in cameras for pose in camera.poses])
    if contradiction is not None:
        notes.append(contradiction)
    tool = tool_of(form, text)
    return Calibration(tuple(cameras), form.name, source, tuple(notes), tool)


def _check_names(names: list[str], path: Path) -> None:
    duplicate = next((name for name in names if names.count(name) > 1), None)
    if duplicate is not None:
        raise CalibrationError(f"{path}: expected different names, got two cameras {duplicate!r}")


# Models that may be near to rays per pixel.
_NEAR_TABLES: tuple[tuple[type[CentralCamera], base.Fixed], ...] = (
    (UnifiedCamera, base.ANY), (UnifiedCamera, base.PINHOLE), (KannalaBrandtCamera, base.ANY),
    (EucmCamera, base.ANY), (RationalPolynomialCamera, base.ANY),
    (ThinPrismFisheyeCamera, base.ANY), (OcamcalibCamera, base.ANY), (RadialTableCamera, base.ANY),
)  # fmt: skip


def _read_table(path: Path, theta_max_rad: float | None) -> Calibration:
    """Read a table of rays as the nearest model."""
    from omnisim.cameras.calibration.ray_table import read_table_lens  # loads OpenImageIO

    table, mirrored = read_table_lens(path)
    lens, note = _nearest_model(table, str(path), _NEAR_TABLES)
    if theta_max_rad is not None and isinstance(lens, ParametricCamera):
        lens = lens.ending_at(theta_max_rad) or lens
    camera = MirroredCamera(lens) if mirrored else lens
    notes = (note, *field_notes(camera))
    return Calibration((CalibratedCamera("camera", camera, notes=notes),), "ray_table", str(path))


def _nearest_model(
    lens: CentralCamera, source: str, models: Sequence[tuple[type[CentralCamera], base.Fixed]]
) -> tuple[CentralCamera, str]:
    """Model of omnisim nearest to a lens of another model, and a note about its residuals."""
    place = f"{source}: {lens.model_name}"
    best: Fit[CentralCamera] | None = None
    for model, fixed in models:
        try:
            fit = fit_camera(lens, model, fixed=fixed)
        except CalibrationError:
            continue
        if fit.covered > 0.99 and (best is None or fit.residuals.max_px < best.residuals.max_px):
            best = fit
        if best is not None and best.residuals.max_px <= GOOD_PX:
            break
    if best is None:
        raise CalibrationError(f"{place}: no model of omnisim fits this lens")
    name, residuals = best.camera.model_name, best.residuals
    if residuals.max_px > MAX_NEAREST * min(lens.width_px, lens.height_px):
        raise CalibrationError(
            f"{place}: the nearest model of omnisim, {name}, is up to {residuals.max_px:.3g} px off"
        )
    return best.camera, (
        f"omnisim has no model {lens.model_name}: read as {name}, "
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
            f"{place}: center: expected in or near the image of {size[0]:g} × {size[1]:g} px, "
            f"got ({u:g}, {v:g}): do both belong to the same image size?"
        )
    steps = np.linspace(0.0, 1.0, 33)
    grid = np.stack(np.meshgrid(*(steps * (side - 1.0) for side in size)), axis=-1)
    for pixels in (np.rint(center), grid):  # the center has a ray, unless the numbers are invalid
        rays = camera.ray_from_pixel(pixels)
        if (rays.valid & np.isfinite(rays.directions).all(axis=-1)).any():
            return
    raise CalibrationError(f"{place}: no pixel of this camera has a ray: check its numbers")


# Folders with a file for each camera of a rig. A pair of ROS is on its first rectified image.


RIG_FILES = (
    "mav0/cam*/sensor.yaml", "cam*/sensor.yaml", "sensor.yaml", "*CameraParams.yaml",
    "left.yaml right.yaml", "ost.yaml",
)  # fmt: skip


def read_folder(
    folder: Path, format: str | None, mirrored: bool | None, theta_max_rad: float | None = None
) -> Calibration:
    """Read the cameras of a rig's folder, with their poses; the other arguments: `read_cameras`.

    Raises:
        CalibrationError: it is no such folder, or a file is invalid.
    """
    if (folder / EXTRINSICS).is_file():
        cameras = read_kitti360_folder(folder, mirrored, theta_max_rad)
        return Calibration(cameras, FORMAT, str(folder), tool="KITTI-360")
    for patterns in RIG_FILES:
        files = [file for one in patterns.split() for file in sorted(folder.glob(one))]
        if files:
            break
    else:
        raise CalibrationError(
            f"{folder}: expected a calibration file, or KITTI-360's folder with {EXTRINSICS}, or "
            "one with cam0/sensor.yaml, LeftCameraParams.yaml, or left.yaml and right.yaml"
        )
    read = [read_cameras(file, format, mirrored, theta_max_rad) for file in files]
    rig = with_poses([camera for one in read for camera in one.cameras])
    _check_names([camera.name for camera in rig], folder)
    notes = tuple(dict.fromkeys(note for one in read for note in one.file_notes))
    return Calibration(tuple(rig), read[0].format, str(folder), notes, read[0].tool)


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
        CalibrationError: a file is invalid.
    """
    cameras = []
    for name, matrix in _extrinsics(folder / EXTRINSICS).items():
        file = folder / f"{name}.yaml"
        if file.is_file():
            read = read_cameras(file, FORMAT, mirrored, theta_max_rad)
            (camera,), poses = read.cameras, (NamedPose(BODY, name, matrix),)
            notes = (*read.file_notes, *camera.notes)
            cameras.append(dataclasses.replace(camera, name=name, poses=poses, notes=notes))
    if not cameras:
        raise CalibrationError(f"{folder}: expected image_02.yaml or image_03.yaml, got neither")
    return tuple(cameras)


def _extrinsics(path: Path) -> dict[str, Floats]:
    """Poses (4, 4) imu_from_camera by camera name."""
    poses = {}
    for number, line in enumerate(documents.read_text(path).splitlines(), start=1):
        name, colon, text = line.partition(":")
        if not line.strip():
            continue
        place = f"{path}:{number}"
        if not colon:
            raise CalibrationError(f"{place}: expected image_00: and 12 numbers, got {line[:40]!r}")
        values = documents.counted(
            [documents.parse_number(word, place) for word in text.split()], NUMBERS, place
        )
        poses[name.strip()] = documents.pose(np.reshape(values, (3, 4)).tolist(), place)
    return poses
