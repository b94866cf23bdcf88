"""ROS CameraInfo lenses, in YAML files and in Foxglove's JSON.

| distortion_model | D | model |
| --- | --- | --- |
| plumb_bob | k1 k2 p1 p2 k3 | perspective, unified with ξ = 0 |
| rational_polynomial | k1 k2 p1 p2 k3 k4 k5 k6 | rational_polynomial, or as plumb_bob |
| equidistant (fisheye, kannala_brandt) | k1 k2 k3 k4, skew in K | kannala_brandt |

Pixel (0, 0) is the center of the first pixel, as in omnisim. Rays at or beyond 90° from the axis
have no model: `P` and every rectified image lie in a plane.

camera_info_manager stores a YAML file with `camera_matrix: {rows, cols, data}`; camera_calibration
writes fisheyes with `camera_model: fisheye` in place of a distortion model, and ost.txt, which has
no model: four coefficients are a fisheye's. `ros2 topic echo` and `rostopic echo` print messages,
with `k`, `d` or `K`, `D`, and `---` between them: each different one is a camera. RealSense's T265
has five numbers in `d`, of which librealsense's projection reads four.

`R` and the baseline in `P` of a stereo pair are a camera's pose on the frame `rectified`, that of
the first rectified image.

Source: sensor_msgs/CameraInfo, image_pipeline/CameraInfo; camera_calibration's calibrator.py.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
    ThinPrismFisheyeCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import CalibratedCamera, NamedPose, find_pose
from omnisim.cameras.calibration.documents import (
    ForeignTable,
    MatrixTable,
    Unread,
    parse,
    unexpected,
)
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Number

OTHERS = {"fisheye62": "Foxglove's alone: ROS has equidistant"}
FISHEYE62 = "fisheye62"
T265 = (
    "distortion_model: plumb_bob, but the frame is a fisheye's: early RealSense drivers named the "
    "T265's Kannala-Brandt lens so; if it is one, write equidistant"
)
RECTIFIED = "rectified"  # frame of the first rectified image of a stereo pair
SIDES = ("width", "height")
CameraT = TypeVar("CameraT", ParsedCamera[CentralCamera], CalibratedCamera)
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
CameraInfoLens = (
    UnifiedCamera | RationalPolynomialCamera | KannalaBrandtCamera | ThinPrismFisheyeCamera
)


class CameraInfoMessage(
    ForeignTable,
    unread={
        "binning_x binning_y": Unread("the camera has the full image size", (1,)),
        "roi": Unread("the camera has the full image size"),
    },
    harmless="timestamp header",
):
    """sensor_msgs/CameraInfo, or Foxglove's CameraCalibration."""

    frame_id: str = ""
    width: documents.Size
    height: documents.Size
    distortion_model: str
    D: documents.Numbers
    K: documents.Numbers
    P: tuple[Number, ...] = ()
    R: tuple[Number, ...] = ()


class CameraInfo(Format[CameraInfoLens]):
    """Base of the formats with a CameraInfo: names of Brown's and of the Kannala-Brandt models."""

    models: tuple[type[CameraInfoLens], ...] = (
        UnifiedCamera,
        RationalPolynomialCamera,
        KannalaBrandtCamera,
    )
    fits = (
        (UnifiedCamera, base.PINHOLE),
        (RationalPolynomialCamera, ANY),
        (KannalaBrandtCamera, ANY),
    )
    max_theta_rad = 0.5 * math.pi
    distortion_models: tuple[str, ...]
    fisheye_models: tuple[str, ...]

    def camera(self, document: Any, source: str) -> ParsedCamera[CentralCamera]:
        """Parse the camera of a message."""
        fields = parse(document, CameraInfoMessage, source)
        size_px = fields.width, fields.height
        lens = self._lens(size_px, fields.distortion_model, fields.K, fields.D, source, ("K", "D"))
        notes = _turn_notes(fields.R, fields.P, "R")
        if fields.distortion_model == "plumb_bob" and "fisheye" in fields.frame_id:
            notes = (*notes, T265)
        name = fields.frame_id or "camera"
        poses = stereo_poses(name, fields.R, fields.P, source)
        return ParsedCamera(name, lens, poses, notes=notes)

    def _lens(
        self,
        size_px: tuple[int, int],
        model: str,
        matrix: Sequence[float],
        coefficients: Sequence[float],
        source: str,
        keys: tuple[str, str],
    ) -> CentralCamera:
        """Lens from an image size, distortion model, K and D; `keys` name K and D in messages."""
        intrinsics, skew_px = base.matrix_intrinsics(size_px, matrix, f"{source}: {keys[0]}")
        if not (self.fisheye_skew and model in self.fisheye_models):
            base.check_no_skew(skew_px, f"{source}: {keys[0]}")
        expected = (*self.distortion_models, *self.fisheye_models)
        documents.check_choice(model, expected, f"{source}: distortion_model", OTHERS)
        with error_context(source):
            if model == FISHEYE62:
                shape = documents.counted(
                    coefficients, "k0 k1 k2 k3 k4 k5 p0 p1", f"{source}: {keys[1]}"
                )
                return ThinPrismFisheyeCamera(*intrinsics, tuple(shape[:6]), tuple(shape[6:]))
            if model in self.fisheye_models:
                return base.fisheye(intrinsics, coefficients, f"{source}: {keys[1]}", skew_px)
            return base.brown_pinhole(intrinsics, coefficients, f"{source}: {keys[1]}")


def stereo_poses(
    name: str, rotation: Sequence[float], projection: Sequence[float], place: str
) -> tuple[NamedPose, ...]:
    """Pose of a camera from R and P; none if they are those of a single camera."""
    r = rotation if any(rotation) else IDENTITY
    has_baseline = len(projection) == 12 and bool(projection[3] or projection[7])
    if not any(projection) or (tuple(r) == IDENTITY and not has_baseline):
        return ()
    with error_context(place):
        return (NamedPose(RECTIFIED, name, base.rectified_pose(r, projection, place)),)


def _turn_notes(
    rotation: Sequence[float], projection: Sequence[float], key: str
) -> tuple[str, ...]:
    """Note on a rotation onto rectified images without the projection that has the baseline."""
    if any(projection) or not any(rotation) or tuple(rotation) == IDENTITY:
        return ()
    return (f"{key} = {documents.short(list(rotation))} is not read without a projection",)


def with_poses(cameras: Sequence[CameraT]) -> list[CameraT]:
    """Cameras of a pair, each with a pose, since that of the first may be the identity."""
    if not any(pose.target == RECTIFIED for camera in cameras for pose in camera.poses):
        return list(cameras)
    alike = {camera.name: (NamedPose(RECTIFIED, camera.name, np.eye(4)),) for camera in cameras}
    return [replace(camera, poses=camera.poses or alike[camera.name]) for camera in cameras]


Row = list[float]


def camera_info(
    lens: CameraInfoLens, on_rectified: Floats | None = None
) -> tuple[str, Row, Row, Row, Row]:
    """Fields of the message: distortion model in ROS's terms, D, K, R and P.

    `on_rectified` is the pose (4, 4) of a camera of a stereo pair on the frame `rectified`.
    """
    (fx, fy), (cx, cy) = lens.focal_lengths_px, lens.principal_point_px
    skew_px = lens.skew_px if isinstance(lens, KannalaBrandtCamera) else 0.0
    pose = np.eye(4) if on_rectified is None else on_rectified
    tx, ty = (-pose[:2, 3] * (fx, fy) + 0.0).tolist()
    k = [fx, skew_px, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    p = [fx, 0.0, cx, tx, 0.0, fy, cy, ty, 0.0, 0.0, 1.0, 0.0]
    return *_distortion(lens), k, pose[:3, :3].ravel().tolist(), p


def _distortion(lens: CameraInfoLens) -> tuple[str, list[float]]:
    if isinstance(lens, KannalaBrandtCamera):
        return "equidistant", list(lens.coefficients)
    if isinstance(lens, ThinPrismFisheyeCamera):
        return FISHEYE62, [*lens.coefficients, *lens.tangential]
    if isinstance(lens, RationalPolynomialCamera):
        return "rational_polynomial", list(lens.distortion[:8])
    return "plumb_bob", [*lens.distortion[:4], lens.k3]


_MESSAGE = re.compile(r"^[kK][ \t]*:", re.M)
_LAST = r"^roi[ \t]*:"  # key of a message
_OST = re.compile(r"^camera matrix[ \t\r]*$", re.M)
_OST_KEYS = {
    "camera matrix": "camera_matrix", "distortion": "distortion_coefficients",
    "rectification": "rectification_matrix", "projection": "projection_matrix",
}  # fmt: skip
_OST_MODELS = {4: "equidistant", 5: "plumb_bob", 8: "rational_polynomial"}


class _Camera(
    ForeignTable,
    inner=dict.fromkeys(
        ("camera_matrix", "distortion_coefficients", "rectification_matrix"), MatrixTable
    ),
):
    image_width: documents.Size
    image_height: documents.Size
    camera_name: str = "camera"
    camera_model: str = ""
    camera_matrix: MatrixTable
    distortion_model: str
    distortion_coefficients: MatrixTable
    projection_matrix: MatrixTable | None = None
    rectification_matrix: MatrixTable | None = None


class Ros(CameraInfo):
    """Format of ROS's camera_info_manager."""

    name = "ros"
    title = "ROS: CameraInfo yaml"
    suffix = ".yaml"
    signature = re.compile(
        r"^(distortion_model|projection_matrix|rectification_matrix)[ \t]*:", re.M
    )
    tables = (_Camera, CameraInfoMessage)
    distortion_models = ("plumb_bob", "rational_polynomial")
    fisheye_models = ("equidistant", "fisheye", "kannala_brandt")
    fisheye_skew = True

    def looks_like(self, text: str) -> bool:
        """True for YAML with a camera matrix that is not OpenCV's, and for ost.txt."""
        return bool(_OST.search(text)) or (
            not text.lstrip().startswith("{")
            and "!!opencv-matrix" not in text
            and bool(re.search(r"^(camera_matrix|[kK])[ \t]*:", text, re.M))
            and super().looks_like(text)
        )

    def document(self, text: str, source: str) -> Any:
        """Content of a file, or of the different cameras in messages or in an ost.txt."""
        if _OST.search(text):
            parts = re.split(r"^\[image\]", text, flags=re.M)
            cameras = [_ost_camera(part, source) for part in parts[1:] or parts]
        elif _MESSAGE.search(text):
            cameras = _messages(text, source)
        else:
            return super().document(text, source)
        if len(cameras) == 1:
            return cameras[0]
        key = "frame_id" if "K" in cameras[0] else "camera_name"
        joined = documents.Joined()
        for index, camera in enumerate(cameras):
            name = str(camera.get(key) or "camera")  # both of a pair may have the first's frame
            name = f"{name}_{index + 1}" if name in joined else name
            joined[name] = {**camera, key: name}
        return joined

    def table_of(self, document: Any) -> type[ForeignTable]:
        """Schema of a file or of a message."""
        return CameraInfoMessage if "K" in document else _Camera

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras, with their poses if they are a pair."""
        return with_poses(super().read(document, source))

    def camera(self, document: Any, source: str) -> ParsedCamera[CentralCamera]:
        """Parse the camera of a file or of a message."""
        if "K" in document:
            return super().camera(document, source)
        is_fisheye = document.get("camera_model") == "fisheye"
        extra = {"distortion_model": "fisheye"} if is_fisheye else {}
        fields = parse({**extra, **document}, _Camera, source)
        documents.check_choice(
            fields.camera_model, ("", "pinhole", "fisheye"), f"{source}: camera_model"
        )
        if is_fisheye and fields.distortion_model not in self.fisheye_models:
            place = f"{source}: distortion_model"
            raise unexpected(place, "a fisheye's, as camera_model", fields.distortion_model)
        keys = ("camera_matrix", "distortion_coefficients")
        size_px, matrix = (fields.image_width, fields.image_height), fields.camera_matrix.data
        model, coefficients = fields.distortion_model, fields.distortion_coefficients.data
        lens = self._lens(size_px, model or "plumb_bob", matrix, coefficients, source, keys)
        name, stereo = fields.camera_name or "camera", (
            fields.rectification_matrix, fields.projection_matrix,
        )  # fmt: skip
        r, p = (part.data if part else [] for part in stereo)
        notes = _turn_notes(r, p, "rectification_matrix")
        return ParsedCamera(name, lens, stereo_poses(name, r, p, source), notes=notes)

    def encode(self, cameras: Sequence[ParsedCamera[CameraInfoLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        pose = find_pose(camera.poses, RECTIFIED, camera.name)
        model, d, k, r, p = camera_info(camera.lens, pose)
        text = f"image_width: {camera.lens.width_px}\nimage_height: {camera.lens.height_px}\n"
        text += f"camera_name: {json.dumps(camera.name)}\n"
        text += base.yaml_matrix("camera_matrix", 3, 3, k)
        text += f"distortion_model: {model}\n"
        text += base.yaml_matrix("distortion_coefficients", 1, len(d), d)
        text += base.yaml_matrix("rectification_matrix", 3, 3, r)
        return text + base.yaml_matrix("projection_matrix", 3, 4, p)


def _messages(text: str, source: str) -> list[dict[str, Any]]:
    """Different messages that `ros2 topic echo` or `rostopic echo` printed."""
    parts = [part for part in re.split(r"^---[ \t\r]*$", text, flags=re.M) if part.strip()]
    if re.search(_LAST, parts[0], re.M) and not re.search(_LAST, parts[-1], re.M):
        parts.pop()  # cut by Ctrl-C
    messages = list[dict[str, Any]]()
    for part in parts:
        message = documents.parse_yaml(part, source)
        header = message.pop("header", None)
        named = {"frame_id": header.get("frame_id")} if isinstance(header, dict) else {}
        same = {key.upper() if len(key) == 1 else key: value for key, value in message.items()}
        if named | same not in messages:
            messages.append(named | same)
    return messages


def _ost_camera(text: str, source: str) -> dict[str, Any]:
    """Camera of an ost.txt, with the keys of a YAML file."""
    name, values, key = re.search(r"^\[(.+)\]", text, re.M), dict[str, list[float]](), ""
    for line in text.splitlines():
        words = line.split()
        if words and re.match(r"[-+.\d]", words[0]):
            numbers = (documents.parse_number(word, f"{source}: {key}") for word in words)
            values.setdefault(key, []).extend(numbers)
        elif re.match(r"[A-Za-z]", line):
            key = line.strip()
    camera: dict[str, Any] = {f"image_{side}": values.get(side, [0.0])[0] for side in SIDES}
    camera |= {ours: {"data": values[key]} for key, ours in _OST_KEYS.items() if key in values}
    model = _OST_MODELS.get(len(values.get("distortion", ())), "")
    return {**camera, "camera_name": name[1] if name else "", "distortion_model": model}


# Foxglove's CameraCalibration as JSON: the message with other names. `kannala_brandt` is ROS's
# `equidistant`; `fisheye62`, with k0 … k5, p0, p1, is thin_prism_fisheye without a prism.
#
# Source: Foxglove's schemas, foxglove.CameraCalibration.


class Foxglove(CameraInfo):
    """Format of Foxglove's CameraCalibration."""

    name = "foxglove"
    title = "Foxglove: CameraCalibration json"
    suffix = ".json"
    signature = re.compile(r'\A\s*\{.*"distortion_model"\s*:', re.S)
    metadata_place = base.MetadataPlace.KEY
    distortion_models = ("plumb_bob", "rational_polynomial")
    fisheye_models = ("kannala_brandt", FISHEYE62)
    models = (*CameraInfo.models, ThinPrismFisheyeCamera)
    tables = (CameraInfoMessage,)

    def unsupported(self, lens: CameraInfoLens) -> str | None:
        """Reason why the format cannot represent a lens of one of its models, or None."""
        if isinstance(lens, ThinPrismFisheyeCamera) and any(lens.prism):
            return "it has no thin prism"
        return super().unsupported(lens)

    def encode(self, cameras: Sequence[ParsedCamera[CameraInfoLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        pose = find_pose(camera.poses, RECTIFIED, camera.name)
        model, d, k, r, p = camera_info(camera.lens, pose)
        data = {
            "timestamp": {"sec": 0, "nsec": 0}, "frame_id": camera.name,
            "width": camera.lens.width_px, "height": camera.lens.height_px,
            "distortion_model": "kannala_brandt" if model == "equidistant" else model, "D": d,
            "K": k, "R": r, "P": p,
        }  # fmt: skip
        return json.dumps(data, indent=2) + "\n"
