"""omnisim's own metadata about a camera, in files whose format has no field for it.

Each camera has one JSON object: in a comment line `# omnisim {…}`, in an XML comment, or under the
key `omnisim`. Other readers of the format ignore it.

| key | |
| --- | --- |
| camera | camera name in the file |
| mirrored | true: the camera looks into a mirror; rays (x, y, z) are (x, y, −z) in the file |
| turned | true: rays are (−x, −y, −z) in the file, as an elliptic mirror's |
| theta_max_rad | angle from the axis where the camera's domain ends |
| fitted_from | model of the source camera of the fit |
| rms_px, max_px | residuals of the fit, within cone_deg of the axis |
| at_distances | residuals by distance_m of a fit to non-central optics; no distance: infinity |
| optics_from_camera | 4 × 4 pose in those optics' optical frame: the viewpoint, and axes |
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from omnisim.cameras import (
    CentralCamera,
    EllipticCamera,
    HyperbolicCamera,
    MirroredCamera,
    ParabolicCamera,
    PerspectiveCamera,
    PlanarCamera,
    StereographicCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import (
    OPTICS,
    CentralError,
    NamedPose,
    Residuals,
    find_pose,
)
from omnisim.cameras.calibration.documents import ForeignTable
from omnisim.cameras.calibration.equivalents import equivalent, is_plain
from omnisim.cameras.calibration.formats.format import MetadataPlace
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.models.field_of_view import optical_axis
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.errors import CalibrationError, OpticsError
from omnisim.core.files.parameters import Flag, Number

_COMMENTS = {
    MetadataPlace.LINES: ("# ", "", re.compile(r"^# omnisim (\{.*)$", re.M)),
    MetadataPlace.SLASHES: ("// ", "", re.compile(r"^// omnisim (\{.*)$", re.M)),
    MetadataPlace.XML: ("<!-- ", " -->", re.compile(r"^<!-- omnisim (\{.*) -->$", re.M)),
}
Angle = Annotated[Number, Field(gt=0.0, le=math.pi)]


class DistanceMetadata(ForeignTable):
    """Residuals for points at one distance."""

    distance_m: Number | None = None
    mean_px: Number
    median_px: Number
    percentile_99_px: Number
    max_px: Number
    left_out: Number = 0.0

    @classmethod
    def of(cls, error: CentralError) -> DistanceMetadata:
        """Build the metadata from residuals."""
        values = error._asdict()
        if math.isinf(error.distance_m):
            values["distance_m"] = None
        return cls(**values)

    @property
    def error(self) -> CentralError:
        """Residuals at this distance, as a `CentralError`."""
        distance_m = math.inf if self.distance_m is None else self.distance_m
        return CentralError(**{**dict(self), "distance_m": distance_m})


class CameraMetadata(ForeignTable):
    """Metadata of one camera."""

    camera: str
    mirrored: Flag = False
    turned: Flag = False
    theta_max_rad: Angle | None = None
    fitted_from: str | None = None
    rms_px: Number | None = None
    max_px: Number | None = None
    cone_deg: Number | None = None
    at_distances: tuple[DistanceMetadata, ...] = ()
    optics_from_camera: documents.Matrix | None = None

    @property
    def residuals(self) -> Residuals | None:
        """Residuals of the fit, if the camera was fitted."""
        match self.fitted_from, self.rms_px, self.max_px, self.cone_deg:
            case str(model), float(rms_px), float(max_px), float(cone_deg):
                errors = tuple(distance.error for distance in self.at_distances)
                return Residuals(rms_px, max_px, math.radians(cone_deg), model, errors)
        return None

    def with_poses(self, poses: Sequence[NamedPose]) -> CameraMetadata:
        """The same metadata with the camera's pose in the source optics of its fit, if any."""
        matrix = find_pose(poses, OPTICS, self.camera)
        if matrix is None:
            return self
        return self.model_copy(update={"optics_from_camera": documents.rows(matrix)})

    def poses(self, others: Sequence[NamedPose], place: str) -> tuple[NamedPose, ...]:
        """Poses in the file, plus the pose in the source optics if the format cannot hold it.

        Raises:
            CalibrationError: a matrix is not a pose; `place` names it.
        """
        if self.optics_from_camera is None or any(pose.target == OPTICS for pose in others):
            return tuple(others)
        matrix = documents.pose(self.optics_from_camera, f"{place}: optics_from_camera")
        return (*others, NamedPose(OPTICS, self.camera, matrix))


def embed_metadata(text: str, metadata: Sequence[CameraMetadata], place: MetadataPlace) -> str:
    """Embed the cameras' metadata in a file's text, omitting defaults."""
    entries = [camera.model_dump(mode="json", exclude_defaults=True) for camera in metadata]
    entries = [entry for entry in entries if len(entry) > 1]
    if not entries:
        return text
    if place is MetadataPlace.KEY:
        return json.dumps({**json.loads(text), "omnisim": entries}, indent=2) + "\n"
    if place is MetadataPlace.CAMERA:
        cameras = json.loads(text)
        for entry in entries:
            cameras[entry["camera"]]["omnisim"] = entry
        return json.dumps(cameras, indent=2) + "\n"
    opening, closing, _ = _COMMENTS[place]
    # XML comments must not contain "--"
    lines = ["omnisim " + json.dumps(entry).replace("--", "-\\u002d") for entry in entries]
    if any(entry.get("mirrored") for entry in entries):
        lines.append("mirrored: (x, y, z) here is (x, y, -z) of the camera, which faces a mirror")
    return text + "".join(f"{opening}{line}{closing}\n" for line in lines)


def read_metadata(text: str, place: MetadataPlace, source: str) -> dict[str, CameraMetadata]:
    """Metadata in a file of a format, by camera name; `source` names the file in messages.

    Raises:
        CalibrationError: the metadata is malformed.
    """
    where = f"{source}: omnisim's metadata"
    if place is MetadataPlace.CAMERA:
        cameras = (
            () if text.lstrip().startswith("[") else documents.parse_json(text, source).values()
        )
        entries = [camera["omnisim"] for camera in cameras if "omnisim" in camera]
    elif place is MetadataPlace.KEY:
        entries = documents.parse_json(text, source).get("omnisim", [])
        if not isinstance(entries, list):
            raise CalibrationError(f"{where}: expected a list, got {type(entries).__name__}")
    else:
        entries = [documents.parse_json(line, where) for line in _COMMENTS[place][2].findall(text)]
    parsed = (documents.parse(entry, CameraMetadata, where) for entry in entries)
    return {metadata.camera: metadata for metadata in parsed}


# Conversion between the optical frame and the file frame, in which cameras look along +z.
#
# A mirror's ray (x, y, z) is (x, y, −z) in a file. Reading recovers the mirror's own model if the
# lens model, the image and the rim's angle determine it, and otherwise a `MirroredCamera`.


def is_catadioptric(camera: CentralCamera) -> bool:
    """True for a camera that looks along −z of its optical frame, as below a mirror."""
    return isinstance(camera, MirroredCamera) or optical_axis(camera) < 0.0


def lens_of(camera: CentralCamera) -> CentralCamera | None:
    """Lens equivalent to a camera, for mirrors with z of the rays reversed; None: no such lens."""
    size, center = (camera.width_px, camera.height_px), camera.principal_point_px
    match camera:
        case MirroredCamera(lens=lens):
            return lens
        case PlanarCamera(focal_length_px=focal):
            return PerspectiveCamera(*size, focal, center)
        case ParabolicCamera(horizon_radius_px=radius, theta_max_rad=limit):
            return StereographicCamera(*size, 0.5 * radius, center, limit)
        case EllipticCamera(half_angle_ratio=ratio):
            xi = (ratio * ratio - 1.0) / (ratio * ratio + 1.0)
            gamma = camera.focal_length_px * (1.0 + xi) / ratio
            return UnifiedCamera(*size, (gamma, gamma), center, xi)
        case HyperbolicCamera(unified_focal_length_px=gamma):
            return UnifiedCamera(*size, (gamma, gamma), center, camera.mirror.xi)
    return None if is_catadioptric(camera) else camera


def camera_metadata(
    name: str, camera: CentralCamera | None, limit_rad: float | None, residuals: Residuals | None
) -> CameraMetadata:
    """Metadata of a camera that a file describes by `lens_of`, or natively (None).

    `limit_rad` is the angle from the axis where the domain ends; residuals are of a fitted lens.
    """
    metadata = CameraMetadata(
        camera=name, mirrored=camera is not None and is_catadioptric(camera),
        turned=isinstance(camera, EllipticCamera), theta_max_rad=limit_rad,
    )  # fmt: skip
    if residuals is None:
        return metadata
    with_number = (error for error in residuals.at_distances if error.left_out < 1.0)
    fit = {
        "fitted_from": residuals.source_model, "rms_px": residuals.rms_px,
        "max_px": residuals.max_px, "cone_deg": math.degrees(residuals.theta_max_rad),
        "at_distances": tuple(map(DistanceMetadata.of, with_number)),
    }  # fmt: skip
    return metadata.model_copy(update=fit)


def camera_from_lens(lens: CentralCamera, metadata: CameraMetadata) -> CentralCamera:
    """Camera represented by the lens in a file."""
    mirrored, limit_rad = metadata.mirrored, metadata.theta_max_rad
    if limit_rad is not None and isinstance(lens, ParametricCamera):
        ended = lens.ending_at(limit_rad)
        if ended is not None:
            lens, limit_rad = ended, None
    special = _special_camera(lens, mirrored, metadata.turned, limit_rad)
    if special is not None:
        return special
    return MirroredCamera(lens) if mirrored else lens


def _special_camera(
    lens: CentralCamera, mirrored: bool, turned: bool, limit_rad: float | None
) -> CentralCamera | None:
    """Mirror or lens model that is this special case of the unified model, or None."""
    unified = equivalent(lens, UnifiedCamera)
    if unified is None or not is_plain(unified):
        return None
    gamma, other = unified.focal_lengths_px
    # a difference of rounding size is not a second focal length
    if abs(gamma - other) > 4e-16 * gamma:
        return None
    size, center, xi = (lens.width_px, lens.height_px), lens.principal_point_px, unified.xi
    if limit_rad is None:
        return PlanarCamera(*size, gamma, center) if mirrored and xi == 0.0 else None
    try:
        if abs(xi - 1.0) < 1e-15:
            if mirrored:
                return ParabolicCamera(*size, gamma, center, limit_rad)
            return StereographicCamera(*size, 0.5 * gamma, center, limit_rad)
        root = math.sqrt(max((1.0 - xi) * (1.0 + xi), 0.0))
        if mirrored and turned and 0.0 < xi < 1.0:
            focal = gamma / root  # γ K/(1 + ξ)
            return EllipticCamera(*size, focal, center, xi / (1.0 + root), limit_rad)
        if mirrored and xi < 1.0:
            k = 1.0 + 1.0 / root
            mirror = HyperbolicMirror(k=k, theta_max_rad=limit_rad)
            return HyperbolicCamera(*size, gamma * (k - 1.0), center, mirror)
    except OpticsError:  # a rim that this mirror cannot have
        return None
    return None
