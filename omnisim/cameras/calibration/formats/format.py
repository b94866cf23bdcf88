"""Base of the calibration file formats, and parts that many of them share.

Lists of numbers that are not as expected raise a `CalibrationError` that names their place, and
numbers of no valid camera an `OpticsError`.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from itertools import chain
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from omnisim.cameras import (
    CentralCamera,
    EucmCamera,
    KannalaBrandtCamera,
    PerspectiveCamera,
    RationalPolynomialCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose, find_pose
from omnisim.cameras.calibration.documents import (
    ForeignTable,
    counted,
    parse_json,
    parse_yaml,
    short,
    unexpected,
    unread_keys,
)
from omnisim.cameras.calibration.equivalents import equivalent
from omnisim.cameras.camera import without_prefix
from omnisim.cameras.parametric_camera import ParametricCamera, RadialCamera, TwoFocalCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError, OpticsError
from omnisim.core.poses import pose_from_rotation, rotation_from_quaternion

LensT = TypeVar("LensT", bound=CentralCamera)
LensT_co = TypeVar("LensT_co", bound=CentralCamera, covariant=True)
Fixed = Mapping[str, Any]
ANY: Fixed = {}
PINHOLE: Fixed = {"xi": 0.0}  # makes the unified model a pinhole camera with distortion
SHOWN_KEYS = 8  # unknown keys that a notice names
NO_SKEW: Fixed = {"skew_px": 0.0}  # drops skew and k3, which most formats lack


class MetadataPlace(Enum):
    """Location of omnisim's metadata in a format; see `omnisim.cameras.calibration.metadata`."""

    LINES = "# omnisim {…}"
    SLASHES = "// omnisim {…}"
    XML = "<!-- omnisim {…} -->"
    KEY = '"omnisim": […]'
    CAMERA = '"omnisim": {…} in each camera'  # of files whose keys are cameras


@dataclass(frozen=True, eq=False)
class ParsedCamera(Generic[LensT_co]):
    """One camera as its file describes it."""

    name: str
    lens: LensT_co  # camera model that looks along +z of the file frame
    # poses, time_shift_s: camera poses in the file, and offset from camera timestamps to IMU
    # timestamps
    poses: tuple[NamedPose, ...] = ()
    time_shift_s: float = 0.0
    notes: tuple[str, ...] = ()  # contradictions in the file, one sentence each


def _parts(document: Any) -> dict[str, Any]:
    """Documents that were joined, by name; "": it is a single one."""
    return document if isinstance(document, documents.Joined) else {"": document}


class Format(ABC, Generic[LensT]):
    """File format for lenses of the models `LensT`.

    Attributes:
        name: name on the command line.
        title: tool and file, for lists.
        suffix: file suffix.
        models: models that the format represents exactly.
        fits: models to fit to other lenses, each with the parameters that the format fixes.
        signature: text pattern that identifies the format, even in a broken file.
        metadata_place: location of omnisim's metadata in a file.
        max_theta_rad: angle from the axis at and beyond which rays cannot be represented.
        caveat: note for the user about a lens that sees farther than caveat_theta_rad.
        centered: True if the axis is always at the image center.
        several: True if a file can hold several cameras.
        tables: schemas of its kinds of files; empty: files without keys.
        has_names: True if cameras have names in the file.
        unified_terms: terms among "ξ", "skew", "k3" and "thin prism or tilt" that the format's
            unified or pinhole camera has.
        fisheye_skew: True if the format's Kannala-Brandt lens has a skew.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    suffix: ClassVar[str]
    models: tuple[type[LensT], ...]
    fits: tuple[tuple[type[LensT], Fixed], ...]
    signature: ClassVar[re.Pattern[str]]
    metadata_place: ClassVar[MetadataPlace] = MetadataPlace.LINES
    max_theta_rad: ClassVar[float] = math.inf
    caveat: ClassVar[str] = ""
    caveat_theta_rad: ClassVar[float] = 0.5 * math.pi
    centered: ClassVar[bool] = False
    several: ClassVar[bool] = False
    tables: ClassVar[tuple[type[ForeignTable], ...]] = ()
    has_names: ClassVar[bool] = True
    unified_terms: ClassVar[frozenset[str]] = frozenset({"k3"})
    fisheye_skew: ClassVar[bool] = False

    def looks_like(self, text: str) -> bool:
        """True if the text looks like a file of this format."""
        return bool(self.signature.search(text))

    def ambiguity(self, text: str, source: str) -> str | None:
        """Reason why the user has to name the format, or None."""
        return None

    def document(self, text: str, source: str) -> Any:
        """Content of a file: keys with values, or the text itself if the format has no keys.

        Raises:
            CalibrationError: a fault of the syntax; names the file and the line.
        """
        if not self.tables:
            return text
        return {".yaml": parse_yaml, ".json": parse_json}[self.suffix](text, source)

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras of a document; `source` names the file in messages.

        Raises:
            CalibrationError: the file is invalid; names file, key, actual and expected value.
        """
        parts = _parts(document).items()
        return [self.camera(part, f"{source}: {name}" if name else source) for name, part in parts]

    def camera(self, document: Any, source: str) -> ParsedCamera[CentralCamera]:
        """Parse the only camera of a document, in formats with a file for each camera."""
        raise NotImplementedError

    def table_of(self, document: Any) -> type[ForeignTable] | None:
        """Schema of a document."""
        return self.tables[0] if self.tables else None

    def notices(self, document: Any, source: str) -> list[str]:
        """Notes on keys in a document that are not read, one sentence each.

        Raises:
            CalibrationError: the camera would be wrong without one of the keys.
        """
        known: dict[str, str] = {}
        unknown: list[str] = []
        tables = ((name, part, self.table_of(part)) for name, part in _parts(document).items())
        keys = (unread_keys(part, table, name) for name, part, table in tables if table is not None)
        for path, value, meaning in chain.from_iterable(keys):
            if path == "omnisim":  # metadata, read for all formats
                continue
            same = re.sub(r"\.\d+(?=\.)", ".*", path)  # the key in one of many equal tables
            if meaning is None:
                unknown.append(same)
            elif meaning.is_fault:
                raise CalibrationError(f"{source}: {path} = {short(value)}: {meaning.effect}")
            else:
                known.setdefault(same, f"{path} = {short(value)} is not read: {meaning.effect}")
        unknown = list(dict.fromkeys(unknown))
        notes = list(known.values())
        if unknown:
            more = f" and {len(unknown) - SHOWN_KEYS} more" if len(unknown) > SHOWN_KEYS else ""
            names = ", ".join(unknown[:SHOWN_KEYS]) + more
            notes.append(f"unknown keys of the {self.name} file are not read: {names}")
        return notes

    def lens_caveats(self, lens: CentralCamera) -> tuple[str, ...]:
        """Notes on what the format's own tools make of a lens."""
        if not isinstance(lens, KannalaBrandtCamera) or not lens.skew_px:
            return ()
        (_, fy), (_, cy) = lens.focal_lengths_px, lens.principal_point_px
        most_px = abs(lens.skew_px) * max(cy, lens.height_px - 1.0 - cy) / fy
        return (f"OpenCV's undistortion ignores the skew: it is up to {most_px:.2g} px off",)

    @abstractmethod
    def encode(self, cameras: Sequence[ParsedCamera[LensT]]) -> str:
        """Text of a file with the cameras; only one if the format holds no more."""

    def unsupported(self, lens: LensT) -> str | None:
        """Reason why the format cannot represent a lens of one of its models, or None."""
        if isinstance(lens, KannalaBrandtCamera):
            return "it has no skew" if lens.skew_px and not self.fisheye_skew else None
        if isinstance(lens, RationalPolynomialCamera):
            is_simple = not any(lens.distortion[8:]) or "thin prism or tilt" in self.unified_terms
            return None if is_simple else "it has no thin prism or tilt"
        if not isinstance(lens, UnifiedCamera):
            return None
        used = (("ξ", lens.xi), ("skew", lens.skew_px), ("k3", lens.k3))
        missing = (term for term, value in used if value and term not in self.unified_terms)
        return next((f"it has no {term}" for term in missing), None)

    def native(self, camera: CentralCamera) -> LensT | None:
        """The camera itself if the format represents mirrors as mirrors, or None."""
        return None

    def camera_name(self, index: int, name: str) -> str:
        """Camera name in the file, from its index there and its previous name."""
        return name if self.has_names else "camera"


@contextmanager
def error_context(source: str) -> Iterator[None]:
    """Prefix errors about invalid camera numbers with their place in a file.

    Raises:
        CalibrationError: the error raised in the block, prefixed with `source`.
    """
    try:
        # squares of far too large numbers need no warning: the camera is rejected below
        with np.errstate(all="ignore"):
            yield
    except OpticsError as reason:
        message = without_prefix(reason).partition("\n")[0]
        raise CalibrationError(f"{source}: {message}") from None
    except (ArithmeticError, ValueError, RecursionError, np.linalg.LinAlgError) as reason:
        raise CalibrationError(f"{source}: expected numbers of a camera: {reason}") from None


# Camera matrices, and pinhole cameras with Brown's distortion.


COEFFICIENT_COUNTS = (0, 4, 5, 8, 12, 14)  # allowed by OpenCV


class Intrinsics(NamedTuple):
    """Leading parameters of all models with two focal lengths."""

    width_px: int
    height_px: int
    focal_lengths_px: tuple[float, float]
    principal_point_px: tuple[float, float]


def matrix_intrinsics(
    size_px: tuple[int, int], matrix: Sequence[float], place: str
) -> tuple[Intrinsics, float]:
    """Intrinsics and skew of a row-major camera matrix K; `place` names it in messages."""
    fx, skew, cx, zero, fy, cy, *last_row = counted(matrix, "fx s cx 0 fy cy 0 0 1", place)
    if [zero, *last_row] != [0.0, 0.0, 0.0, 1.0]:
        raise unexpected(place, "[fx, s, cx, 0, fy, cy, 0, 0, 1]", matrix)
    return Intrinsics(*size_px, (fx, fy), (cx, cy)), skew


def check_no_skew(skew_px: float, place: str) -> None:
    """Reject a skew."""
    if skew_px:
        raise unexpected(place, "no skew", skew_px)


def fisheye(
    intrinsics: Intrinsics, coefficients: Sequence[float], place: str, skew_px: float = 0.0
) -> KannalaBrandtCamera:
    """Kannala-Brandt lens with k1, k2, k3, k4; `place` names these in messages.

    librealsense states a T265 by five numbers; its own projection reads the first four.
    """
    if len(coefficients) == 5 and coefficients[4] == 0.0:
        coefficients = coefficients[:4]
    four = counted(coefficients, "k1 k2 k3 k4", place)
    return KannalaBrandtCamera(*intrinsics, tuple(four), skew_px=skew_px)


def pinhole(
    intrinsics: Intrinsics, distortion: Sequence[float] = (0.0,) * 4, skew_px: float = 0.0
) -> CentralCamera:
    """Pinhole camera with k1, k2, p1, p2 (k3): unified with ξ = 0, or the perspective model."""
    unified = UnifiedCamera(*intrinsics, 0.0, tuple(distortion), skew_px)
    return equivalent(unified, PerspectiveCamera) or unified


def brown_pinhole(
    intrinsics: Intrinsics, coefficients: Sequence[float], place: str
) -> CentralCamera:
    """Pinhole camera with OpenCV's coefficients, in the simplest model that supports them.

    They are none, or k1 k2 p1 p2, k3, k4 k5 k6, s1 s2 s3 s4, τx τy; `place` names file and key.
    """
    if len(coefficients) not in COEFFICIENT_COUNTS:
        expected = "k1, k2, p1, p2, k3 and optionally k4, k5, k6, s1, s2, s3, s4, τx, τy"
        raise unexpected(place, expected, list(coefficients))
    used = (*map(float, coefficients), *(0.0,) * 8)[: max(8, len(coefficients))]
    if any(used[5:]):
        return RationalPolynomialCamera(*intrinsics, used)
    return pinhole(intrinsics, used[:5] if used[4] else used[:4])


# Poses on one body, and as a position and a quaternion x, y, z, w.


def body_poses(cameras: Sequence[ParsedCamera[Any]]) -> tuple[str, list[Floats | None]]:
    """Body of the cameras, or the first camera, and body_from_camera (4, 4) of each if known."""
    names = [camera.name for camera in cameras]
    poses = [pose for camera in cameras for pose in camera.poses]
    frames = [frame for pose in poses for frame in (pose.target, pose.source)]
    body = next((frame for frame in frames if frame not in names), names[0])
    return body, [find_pose(poses, body, name) if poses else None for name in names]


def pose_from_quaternion(
    position_m: Sequence[float], quaternion: Sequence[float], place: str
) -> Floats:
    """Pose (4, 4) from a position and a quaternion of any length except 0."""
    length = float(np.linalg.norm(np.clip(quaternion, -1e100, 1e100)))
    if not 1e-9 < length < 1e99:
        raise unexpected(f"{place}: quaternion", "x, y, z, w of length 1", list(quaternion))
    return pose_from_rotation(rotation_from_quaternion(np.asarray(quaternion) / length), position_m)


def rectified_pose(rotation: Sequence[float], projection: Sequence[float], place: str) -> Floats:
    """Pose (4, 4) of a camera on a pair's first rectified camera, from R (9) and P (12)."""
    p = counted(projection, "fx 0 cx Tx 0 fy cy Ty 0 0 1 0", f"{place}: P")
    return documents.pose_of(rotation, (-p[3] / p[0], -p[7] / p[5], 0.0), f"{place}: R, P")


def position_and_quaternion(pose: Floats) -> tuple[list[float], list[float]]:
    """Position and quaternion x, y, z, w (of either sign) of a pose (4, 4)."""
    return pose[:3, 3].tolist(), Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()


# Numbers and matrices in YAML that every reader parses as identical floats.


def yaml_float(value: float) -> str:
    """Float that always has a decimal point: YAML 1.1 parses 1e-05 as a string."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e")


def yaml_floats(values: Iterable[float]) -> str:
    """List of floats on one line."""
    return "[" + ", ".join(map(yaml_float, values)) + "]"


def yaml_matrix(
    key: str, rows: int, columns: int, values: Sequence[float], opencv: bool = False
) -> str:
    """Row-major matrix under a key; `opencv`: in the format of `cv2.FileStorage`."""
    tag, indent, kind = (" !!opencv-matrix", "   ", "   dt: d\n") if opencv else ("", "  ", "")
    return (
        f"{key}:{tag}\n{indent}rows: {rows}\n{indent}cols: {columns}\n{kind}"
        f"{indent}data: {yaml_floats(values)}\n"
    )


class ForeignLens(ParametricCamera):
    """Mixin of lenses that omnisim has no model for: they are read as the nearest one."""

    @property
    def nearest_models(self) -> tuple[tuple[type[CentralCamera], Fixed], ...]:
        """Models that may be near, the likeliest first, and the parameters that are fixed."""
        return (
            (UnifiedCamera, ANY), (UnifiedCamera, PINHOLE), (KannalaBrandtCamera, ANY),
            (EucmCamera, ANY),
        )  # fmt: skip


MAX_THETA_RAD = math.radians(88.9)


@dataclass(frozen=True)
class FovLens(TwoFocalCamera, RadialCamera, ForeignLens):
    """FOV lens of Kalibr and COLMAP, r = atan(2 tan θ tan(w/2))/w; read as the nearest model.

    Source: Devernay & Faugeras, "Straight lines have to be straight", 2001.

    Raises:
        OpticsError: w is not between 0 and π.
    """

    w: float  # field of view of the ideal fisheye, in radians
    model_name = "fov"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1e-6 < self.w < math.pi:
            raise OpticsError(f"camera: w: expected more than 0 and less than π, got {self.w:g}")

    @property
    def theta_edge_rad(self) -> float:
        """Angle from +z where the domain ends."""
        return MAX_THETA_RAD

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return np.asarray(np.arctan(2.0 * math.tan(0.5 * self.w) * np.tan(theta)) / self.w)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return np.asarray(np.arctan(np.tan(radius * self.w) / (2.0 * math.tan(0.5 * self.w))))
