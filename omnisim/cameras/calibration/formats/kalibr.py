"""Kalibr's camchain.yaml, and files with its models: EuRoC's sensor.yaml, OKVIS2's settings.

| camera_model | intrinsics | distortion_model | model |
| --- | --- | --- | --- |
| pinhole | fu fv pu pv | radtan, none | perspective, unified with ξ = 0 |
| pinhole | fu fv pu pv | equidistant | kannala_brandt |
| pinhole | fu fv pu pv | fov | fitted: omnisim has no such model |
| omni | xi fu fv pu pv | radtan, none | unified |
| ds | xi alpha fu fv pu pv | none | double_sphere |
| eucm | alpha beta fu fv pu pv | none | eucm |

Pixel (0, 0) is the center of the first pixel, as in omnisim. `T_cn_cnm1` maps the previous camera's
frame to this camera's frame, and `T_cam_imu` maps the IMU frame to it; OpenVINS writes its inverse,
`T_imu_cam`. A camera timestamp plus `timeshift_cam_imu` is IMU time. Kalibr reads only floats, so
all numbers are written with a decimal point.

EuRoC's mav0/cam0/sensor.yaml and Kimera's LeftCameraParams.yaml have the same models:
`distortion_model` is `radial-tangential` or `equidistant`, and `T_BS` maps the camera's frame to
the body's, the IMU's. OKVIS2's settings, read only, have `T_SC` for it, also eight coefficients,
and `image_delay`, which is minus the time shift.

Source: Kalibr's wiki, "YAML formats" and "Supported models"; Burri et al., "The EuRoC micro aerial
vehicle datasets", 2016; Kimera's CameraParams.cpp; OKVIS2's ViParametersReader.cpp.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omnisim.cameras import (
    CentralCamera,
    DoubleSphereCamera,
    EucmCamera,
    KannalaBrandtCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose, find_pose
from omnisim.cameras.calibration.documents import ForeignTable, MatrixTable, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Number
from omnisim.core.poses import inverse

INTRINSICS = {
    "pinhole": "fu fv pu pv", "omni": "xi fu fv pu pv", "ds": "xi alpha fu fv pu pv",
    "eucm": "alpha beta fu fv pu pv",
}  # fmt: skip
# keys and models of sensor.yaml and OKVIS2's settings
RENAMED = {
    "distortion_coefficients": "distortion_coeffs", "image_dimension": "resolution",
    "distortion_type": "distortion_model",
}  # fmt: skip
RADTAN = "radial-tangential"
SYNONYMS = {
    RADTAN: "radtan", "radialtangential": "radtan", "plumb_bob": "radtan",
    "plumb_bob8": "radtan8", "radialtangential8": "radtan8",
}  # fmt: skip
OTHERS = {"omni": "its polynomial is that of OCamCalib: pass calib_results.txt"}
DISTORTIONS = {
    "radtan": "k1 k2 p1 p2", "equidistant": "k1 k2 k3 k4", "fov": "w", "none": "",
    "radtan8": "k1 k2 p1 p2 k3 k4 k5 k6",
}  # fmt: skip
PAIRS = {
    "pinhole": ("radtan", "equidistant", "fov", "none", "radtan8"), "omni": ("radtan", "none"),
    "ds": ("none",), "eucm": ("none",),
}  # fmt: skip
KalibrLens = UnifiedCamera | KannalaBrandtCamera | EucmCamera | DoubleSphereCamera


class _Camera(
    ForeignTable,
    unread={"line_delay": documents.ROLLING_SHUTTER},
    harmless="rostopic cam_overlaps sensor_type comment rate_hz camera_type slam_use",
):
    """Camera of a chain."""

    camera_model: str
    intrinsics: documents.Numbers
    distortion_model: str
    distortion_coeffs: tuple[Number, ...] = ()
    resolution: list[documents.Size]
    T_cn_cnm1: documents.Matrix | None = None
    T_cam_imu: documents.Matrix | None = None
    T_imu_cam: documents.Matrix | None = None
    timeshift_cam_imu: Number = 0.0


class _OkvisCamera(ForeignTable):
    T_SC: documents.Numbers
    focal_length: documents.Numbers
    principal_point: documents.Numbers


class _OkvisDelay(ForeignTable):
    image_delay: Number = 0.0


class _Chain(ForeignTable, inner={"*": _Camera}):
    @classmethod
    def reads(cls, key: str, value: Any) -> bool:
        return isinstance(value, dict) and bool({"camera_model", "intrinsics"} & value.keys())


class Kalibr(Format[KalibrLens]):
    """Format of Kalibr's camera chains."""

    name = "kalibr"
    title = "Kalibr: camchain.yaml"
    suffix = ".yaml"
    models = (UnifiedCamera, KannalaBrandtCamera, EucmCamera, DoubleSphereCamera)
    fits = (
        (UnifiedCamera, base.NO_SKEW), (KannalaBrandtCamera, ANY), (EucmCamera, ANY),
        (DoubleSphereCamera, ANY),
    )  # fmt: skip
    signature = re.compile(
        r"""(?:^|[{,]|^[ \t]*-)[ \t]*["']?(camera_model|T_SC)["']?[ \t]*:""", re.M
    )
    several = True
    tables = (_Chain,)
    unified_terms = frozenset({"ξ"})

    def looks_like(self, text: str) -> bool:
        """True for YAML with a camera model and intrinsics."""
        is_json = text.lstrip().startswith("{")
        has_focal_lengths = "intrinsics" in text or "focal_length" in text
        return not is_json and super().looks_like(text) and has_focal_lengths

    def document(self, text: str, source: str) -> Any:
        """Content of a file; a sensor.yaml of EuRoC, and OKVIS2's settings, as a chain."""
        data = documents.parse_yaml(text, source)
        if "sensor_type" in data or "T_BS" in data:
            folder = Path(source).parent.name
            name = folder if re.fullmatch(r"cam\d+", folder, re.ASCII) else "cam0"
            return {str(data.get("camera_id") or name): _chain_camera(data, source)}
        return _chain_of_okvis(data, source) if isinstance(data.get("cameras"), list) else data

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras of the chain."""
        chain = {name: part for name, part in document.items() if _Chain.reads(name, part)}
        if not chain:
            raise unexpected(source, "cam0: with camera_model, intrinsics, …", "no camera")
        cameras, before = [], None
        for name, part in chain.items():
            place = f"{source}: {name}"
            fields = parse(part, _Camera, place)
            poses = tuple(_poses(fields, name, before, place))
            lens, shift_s = _lens(fields, place), fields.timeshift_cam_imu
            first = before is None and fields.T_cn_cnm1 is not None
            notes = ("T_cn_cnm1 is not read: this is the first camera",) if first else ()
            cameras.append(ParsedCamera(name, lens, poses, shift_s, notes))
            before = name
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[KalibrLens]]) -> str:
        """Text of a file with the chain."""
        poses = [pose for camera in cameras for pose in camera.poses]
        text, before = "", None
        for camera in cameras:
            model, numbers, distortion, coefficients = _parameters(camera.lens)
            text += f"{camera.name}:\n"
            for key, source in (("T_cn_cnm1", before), ("T_cam_imu", "imu")):
                matrix = find_pose(poses, camera.name, source) if source else None
                if matrix is not None:
                    text += f"  {key}:\n"
                    text += "".join(f"  - {base.yaml_floats(row)}\n" for row in matrix.tolist())
            text += f"  camera_model: {model}\n"
            text += f"  distortion_coeffs: {base.yaml_floats(coefficients)}\n"
            text += f"  distortion_model: {distortion}\n"
            text += f"  intrinsics: {base.yaml_floats(numbers)}\n"
            text += f"  resolution: [{camera.lens.width_px}, {camera.lens.height_px}]\n"
            text += f"  rostopic: /{camera.name}/image_raw\n"
            if camera.time_shift_s:
                text += f"  timeshift_cam_imu: {base.yaml_float(camera.time_shift_s)}\n"
            before = camera.name
        return text

    def camera_name(self, index: int, name: str) -> str:
        """Name as Kalibr writes it: cam0, cam1, …"""
        return name if re.fullmatch(r"cam\d+", name, re.ASCII) else f"cam{index}"


class Euroc(Kalibr):
    """Format of EuRoC's sensor.yaml, one camera's."""

    name = "euroc"
    title = "EuRoC and Kimera: sensor.yaml"
    several = False

    def looks_like(self, text: str) -> bool:
        """True for YAML with a camera model on a body."""
        is_sensor = re.search(r"^(sensor_type|T_BS)[ \t]*:", text, re.M)
        return is_sensor is not None and super().looks_like(text)

    def encode(self, cameras: Sequence[ParsedCamera[KalibrLens]]) -> str:
        """Text of a file with the camera."""
        (camera,) = cameras
        matrix = find_pose(camera.poses, "imu", camera.name)
        name = f"camera_id: {json.dumps(camera.name)}"
        return "\n".join(sensor_lines(camera.lens, matrix, name)) + "\n"

    camera_name = Format.camera_name


def sensor_lines(lens: KalibrLens, body_from_camera: Floats | None, name: str) -> list[str]:
    """Lines of a sensor.yaml, with one that names the camera; the last five are its lens."""
    model, numbers, distortion, coefficients = _parameters(lens)
    lines = ["sensor_type: camera", name]
    if body_from_camera is not None:
        data = base.yaml_floats((body_from_camera.ravel() + 0.0).tolist())
        lines += ["T_BS:", "  cols: 4", "  rows: 4", f"  data: {data}"]
    return [
        *lines, f"resolution: [{lens.width_px}, {lens.height_px}]", f"camera_model: {model}",
        f"intrinsics: {base.yaml_floats(numbers)}",
        f"distortion_model: {'equidistant' if distortion == 'equidistant' else RADTAN}",
        f"distortion_coefficients: {base.yaml_floats(coefficients or (0.0,) * 4)}",
    ]  # fmt: skip


def _chain_camera(sensor: Mapping[str, Any], place: str) -> dict[str, Any]:
    """Camera of a chain from one of a sensor.yaml, or of OKVIS2's settings."""
    camera = {RENAMED.get(key, key): value for key, value in sensor.items() if key != "camera_id"}
    model = camera.get("distortion_model")
    none = camera.get("distortion_coeffs") in (None, [], [0.0] * 4)
    if none and camera.get("camera_model") in ("ds", "eucm"):
        camera.update(distortion_model="none", distortion_coeffs=[])
    elif isinstance(model, str):
        camera["distortion_model"] = SYNONYMS.get(model, model)
    if "T_BS" in camera:
        where = f"{place}: T_BS"
        data = parse(camera.pop("T_BS"), MatrixTable, where).data
        camera["T_imu_cam"] = documents.flat_pose(data, f"{where}.data").tolist()
    return camera


def _chain_of_okvis(data: dict[str, Any], source: str) -> dict[str, Any]:
    """Chain with the cameras of OKVIS2's settings."""
    general = parse(data.get("camera_parameters", {}), _OkvisDelay, f"{source}: camera_parameters")
    chain = {}
    for index, camera in enumerate(data["cameras"]):
        place = f"{source}: cameras.{index}"
        stated = parse(camera, _OkvisCamera, place)
        kept = {key: value for key, value in camera.items() if key not in _OkvisCamera.model_fields}
        chain[f"cam{index}"] = _chain_camera({
            **kept, "camera_model": "pinhole", "T_BS": {"data": stated.T_SC},
            "intrinsics": [*stated.focal_length, *stated.principal_point],
            "timeshift_cam_imu": 0.0 - general.image_delay,
        }, place)  # fmt: skip
    return chain


def _lens(fields: _Camera, place: str) -> CentralCamera:
    model, distortion = fields.camera_model, fields.distortion_model
    documents.check_choice(model, INTRINSICS, f"{place}: camera_model")
    where = f"{place}: distortion_model with {model}"
    documents.check_choice(distortion, PAIRS[model], where, OTHERS)
    numbers = documents.counted(fields.intrinsics, INTRINSICS[model], f"{place}: intrinsics")
    names = DISTORTIONS[distortion]
    coefficients = documents.counted(fields.distortion_coeffs, names, f"{place}: distortion_coeffs")
    width, height = documents.counted(fields.resolution, "width height", f"{place}: resolution")
    *shape, fu, fv, pu, pv = numbers
    intrinsics = base.Intrinsics(int(width), int(height), (fu, fv), (pu, pv))
    with error_context(place):
        if model == "ds":
            return DoubleSphereCamera(*intrinsics, *shape)
        if model == "eucm":
            return EucmCamera(*intrinsics, *shape)
        if distortion == "equidistant":
            return KannalaBrandtCamera(*intrinsics, tuple(coefficients))
        if distortion == "fov":
            return base.FovLens(*intrinsics, coefficients[0])
        if distortion == "radtan8":
            return base.brown_pinhole(intrinsics, coefficients, f"{place}: distortion_coeffs")
        coefficients = coefficients or [0.0] * 4
        if model == "omni":
            return UnifiedCamera(*intrinsics, shape[0], tuple(coefficients))
        return base.pinhole(intrinsics, coefficients)


def _poses(fields: _Camera, name: str, before: str | None, place: str) -> list[NamedPose]:
    poses = []
    for key, source in (("T_cn_cnm1", before), ("T_cam_imu", "imu"), ("T_imu_cam", "imu")):
        rows = getattr(fields, key)
        if rows is not None and source is not None:
            matrix = documents.pose(rows, f"{place}: {key}")
            matrix = inverse(matrix) if key == "T_imu_cam" else matrix
            poses.append(NamedPose(name, source, matrix))
    return poses


def _parameters(lens: KalibrLens) -> tuple[str, tuple[float, ...], str, tuple[float, ...]]:
    """Model, intrinsics, distortion model and its coefficients."""
    end = (*lens.focal_lengths_px, *lens.principal_point_px)
    if isinstance(lens, DoubleSphereCamera):
        return "ds", (lens.xi, lens.alpha, *end), "none", ()
    if isinstance(lens, EucmCamera):
        return "eucm", (lens.alpha, lens.beta, *end), "none", ()
    if isinstance(lens, KannalaBrandtCamera):
        return "pinhole", end, "equidistant", lens.coefficients
    if lens.xi == 0.0:
        return "pinhole", end, "radtan", lens.distortion[:4]
    return "omni", (lens.xi, *end), "radtan", lens.distortion[:4]
