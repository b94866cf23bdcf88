"""ORB-SLAM3's settings, in both versions: one or two cameras, and the IMU.

| Camera.type | parameters | model |
| --- | --- | --- |
| PinHole | fx fy cx cy, k1 k2 p1 p2 (k3) | perspective, unified with ξ = 0 |
| KannalaBrandt8 | fx fy cx cy, k1 k2 k3 k4 | kannala_brandt |
| Rectified | fx fy cx cy | perspective, both cameras alike |

| version 1.0 | before it | |
| --- | --- | --- |
| Camera1.fx, Camera2.fx, … | Camera.fx, Camera2.fx, … | parameters |
| Stereo.T_c1_c2 | Tlr | maps the second camera's frame to the first's |
| Stereo.b | Camera.bf / Camera.fx | baseline of rectified images, along x |
| IMU.T_b_c1 | Tbc | maps the first camera's frame to the IMU's |

Camera1 and Camera2 are of the images that are tracked; LEFT and RIGHT, with K, D, R and P, are the
pair before its rectification. With DepthMapFactor, a baseline is that of a depth camera, which has
no second image. Pixel (0, 0) is the center of the first pixel, as in omnisim. ORB-SLAM2's files are
as those before version 1.0, without Camera.type, and mostly without the image's size.

Source: ORB-SLAM3's Settings.cc and Tracking.cc; its calibration tutorial.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
import pydantic

from omnisim.cameras import CentralCamera, KannalaBrandtCamera, UnifiedCamera
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import NamedPose, find_pose
from omnisim.cameras.calibration.documents import ForeignTable, MatrixTable, Unread, parse
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError
from omnisim.core.files.parameters import Number
from omnisim.core.poses import pose

OrbSlam3Lens = UnifiedCamera | KannalaBrandtCamera
NAMES = ("Camera1", "Camera2")
RAW = ("LEFT", "RIGHT")
FOCAL = "fx fy cx cy"
SHAPES = {"PinHole": "k1 k2 p1 p2 k3", "KannalaBrandt8": "k1 k2 k3 k4", "Rectified": ""}
MAX_GAP = 0.01  # relative gap between two statements of a baseline that is no contradiction
# Settings that ORB-SLAM3 requires and that no calibration has: values of its examples.
SETTINGS = """\
Camera.fps: 30
Camera.RGB: 1
ORBextractor.nFeatures: 1000
ORBextractor.scaleFactor: 1.2
ORBextractor.nLevels: 8
ORBextractor.iniThFAST: 20
ORBextractor.minThFAST: 7
"""


SIZE: dict[str, Any] = {"width": (documents.Size, ...), "height": (documents.Size, ...)}
HEAD: dict[str, Any] = {"type": (str, "PinHole"), **SIZE}


def _table(harmless: str, matrices: str = "", **fields: Any) -> Any:
    """Schema of keys, among them those of matrices, which are required if `fields` are."""
    inner = dict.fromkeys(matrices.split(), MatrixTable)
    stated = (MatrixTable, ...) if fields.items() >= SIZE.items() else (MatrixTable | None, None)
    keys: dict[str, Any] = dict.fromkeys(inner, stated) | fields
    own: dict[str, Any] = {"inner": inner, "harmless": harmless}
    return pydantic.create_model("Table", __base__=ForeignTable, __cls_kwargs__=own, **keys)


IMAGES = (  # how ORB-SLAM3 takes them
    "fps RGB newWidth newHeight imageScale overlappingBegin overlappingEnd lappingBegin lappingEnd "
    "bFishEye"
)
OPTIONAL = {
    "Stereo": _table("ThDepth", "T_c1_c2", b=(Number, 0.0)),
    "IMU": _table("NoiseGyro NoiseAcc GyroWalk AccWalk Frequency InsertKFsWhenLost", "T_b_c1"),
    "Tbc": MatrixTable,
    "Tlr": MatrixTable,
    **dict.fromkeys(RAW, _table("Rf", "K D R P", **SIZE)),
}
DEPTH = Unread("scale of depth images, whose baseline is no camera's")


class _File(
    ForeignTable,
    unread={"DepthMapFactor RGBD": DEPTH},
    harmless="File ORBextractor Viewer System ThDepth thFarPoints InsertKFsWhenLost loopClosing",
):
    """Keys, those before a point as tables; `_files` adds the tables."""


def _files(model: str) -> tuple[type[_File], type[_File]]:
    """Schemas of a model's file of version 1.0, and before it."""
    least = 0.0 if model == "PinHole" else ...
    keys: dict[str, Any] = {key: (Number, ...) for key in FOCAL.split()}
    keys |= {key: (Number, least) for key in SHAPES[model].split()}
    lens, old = _table(IMAGES, **keys), _table(IMAGES, **HEAD, bf=(Number, 0.0), **keys)
    files = []
    for first in ({"Camera": _table(IMAGES, **HEAD), "Camera1": lens}, {"Camera": old}):
        others = {"Camera2": lens, **OPTIONAL}
        fields: dict[str, Any] = {key: (table, ...) for key, table in first.items()}
        fields |= {key: (table | None, None) for key, table in others.items()}
        own: dict[str, Any] = {"inner": {**first, **others}}
        files.append(pydantic.create_model("File", __base__=_File, __cls_kwargs__=own, **fields))
    return files[0], files[1]


FILES = {model: _files(model) for model in SHAPES}


class OrbSlam3(Format[OrbSlam3Lens]):
    """Format of ORB-SLAM3's settings."""

    name = "orbslam3"
    title = "ORB-SLAM3: settings yaml"
    suffix = ".yaml"
    models = (UnifiedCamera, KannalaBrandtCamera)
    fits = ((UnifiedCamera, base.PINHOLE), (KannalaBrandtCamera, ANY))
    signature = re.compile(r"^[ \t]*Camera1?\.(type|fx)[ \t]*:", re.M)
    several = True
    tables = tuple(chain.from_iterable(FILES.values()))
    caveat = "ORB-SLAM3's own rays end at r/f = 90°"

    def document(self, text: str, source: str) -> Any:
        """Content of a file: tables of the keys before a point."""
        nested: dict[str, Any] = {}
        for path, value in documents.parse_yaml(text, source).items():
            table, point, key = path.partition(".")
            if not point:
                nested[path] = value
            elif isinstance(nested.setdefault(table, {}), dict):
                nested[table][key] = value
        return nested

    def table_of(self, document: Any) -> type[ForeignTable]:
        """Schema of a document by its model and version."""
        camera = document.get("Camera")
        model = camera.get("type") if isinstance(camera, dict) else None
        new, old = FILES.get(str(model), FILES["PinHole"])
        return new if "Camera1" in document else old

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras: those of the tracked images, then those before rectification."""
        head = document.get("Camera")
        if isinstance(head, dict):
            model = str(head.get("type", "PinHole"))
            documents.check_choice(model, FILES, f"{source}: Camera.type")
            if not {"width", "height"} & head.keys():
                raise CalibrationError(
                    f"{source}: Camera.width, Camera.height: missing, as in settings of ORB-SLAM2: "
                    "add the size of the images"
                )
        file: Any = parse(document, self.table_of(document), source)
        key = "Camera1" if "Camera1" in document else "Camera"
        size_px, first = (file.Camera.width, file.Camera.height), getattr(file, key)
        lens = _lens(file.Camera.type, first, size_px, f"{source}: {key}")
        stereo, imu = dict(file.Stereo or ()), dict(file.IMU or ())
        on_imu = {"IMU.T_b_c1": imu.get("T_b_c1"), "Tbc": file.Tbc}
        cameras = [ParsedCamera(NAMES[0], lens, _poses(on_imu, "imu", NAMES[0], source))]
        poses = _poses({"Stereo.T_c1_c2": stereo.get("T_c1_c2"), "Tlr": file.Tlr}, *NAMES, source)
        baseline_m = stereo.get("b") or getattr(file.Camera, "bf", 0.0) / first.fx
        is_depth = bool(document.get("DepthMapFactor") or document.get("RGBD"))
        beside = (NamedPose(*NAMES, pose((baseline_m, 0.0, 0.0))),) if baseline_m else ()
        if file.Camera2 is not None:
            second = _lens(file.Camera.type, file.Camera2, size_px, f"{source}: Camera2")
            notes = list[str]()
            poses = poses or beside
            if isinstance(lens, KannalaBrandtCamera) and second.coefficients != lens.coefficients:
                notes.append("ORB-SLAM3 itself takes k1, k2, k3 and k4 of Camera1 for both lenses")
            for one in poses if baseline_m else ():
                length_m = float(np.linalg.norm(one.target_from_source[:3, 3]))
                if abs(length_m - baseline_m) > MAX_GAP * length_m:
                    gap = f"a baseline of {baseline_m:.4g} m, its pose one of {length_m:.4g} m"
                    notes.append(f"Stereo.b or Camera.bf states {gap}, which is read")
            cameras.append(ParsedCamera(NAMES[1], second, poses, notes=tuple(notes)))
        elif baseline_m and not is_depth and not isinstance(lens, KannalaBrandtCamera):
            cameras.append(ParsedCamera(NAMES[1], lens, (*beside, *poses)))
        elif (baseline_m and not is_depth) or poses:
            note = "the pose or baseline of a second camera is not read: there is no Camera2"
            cameras[0] = dataclasses.replace(cameras[0], notes=(note,))
        raw = {name: getattr(file, name) for name in RAW if getattr(file, name) is not None}
        return cameras + [_raw(name, part, first, source) for name, part in raw.items()]

    def encode(self, cameras: Sequence[ParsedCamera[OrbSlam3Lens]]) -> str:
        """Text of a file of version 1.0 with the cameras."""
        first, lenses = cameras[0].lens, [camera.lens for camera in cameras]
        kinds = {(type(lens), lens.width_px, lens.height_px) for lens in lenses}
        poses = [one for camera in cameras for one in camera.poses]
        second = find_pose(poses, *NAMES) if len(cameras) == 2 else None
        body = find_pose(poses, "imu", NAMES[0])
        if len(cameras) > len(NAMES) or len(kinds) > 1 or (len(cameras) == 2 and second is None):
            raise CalibrationError(
                "orbslam3: expected one camera, or two of one model and one image size with their "
                f"pose to each other, got {len(cameras)}: pass --camera-name or --model"
            )
        model = "KannalaBrandt8" if isinstance(first, KannalaBrandtCamera) else "PinHole"
        text = f'%YAML:1.0\n---\nFile.version: "1.0"\nCamera.type: "{model}"\n'
        for name, lens in zip(NAMES, lenses, strict=False):
            values = [*lens.focal_lengths_px, *lens.principal_point_px]
            if isinstance(lens, KannalaBrandtCamera):
                values += lens.coefficients
            elif any(lens.distortion):
                values += (*lens.distortion[:4], lens.k3)
            for key, value in zip(f"{FOCAL} {SHAPES[model]}".split(), values, strict=False):
                text += f"{name}.{key}: {base.yaml_float(value)}\n"
            text += f"{name}.overlappingBegin: 0\n{name}.overlappingEnd: {lens.width_px - 1}\n"
        text += f"Camera.width: {first.width_px}\nCamera.height: {first.height_px}\n"
        if second is not None:
            text += _matrix("Stereo.T_c1_c2", second) + "Stereo.ThDepth: 40.0\n"
        if body is not None:
            text += _matrix("IMU.T_b_c1", body)
            text += "# of your IMU: IMU.NoiseGyro, .NoiseAcc, .GyroWalk, .AccWalk, .Frequency\n"
        return text + SETTINGS

    def camera_name(self, index: int, name: str) -> str:
        """Name made from the index alone."""
        return f"Camera{index + 1}"


def _lens(model: str, part: Any, size_px: tuple[int, int], place: str) -> Any:
    shape = [getattr(part, key) for key in SHAPES[model].split()]
    intrinsics = base.Intrinsics(*size_px, (part.fx, part.fy), (part.cx, part.cy))
    with error_context(place):
        if model == "KannalaBrandt8":
            return KannalaBrandtCamera(*intrinsics, tuple(shape))
        return base.brown_pinhole(intrinsics, shape, place)


def _poses(
    matrices: Mapping[str, MatrixTable | None], target: str, frame: str, source: str
) -> tuple[NamedPose, ...]:
    """Poses of a frame in another from the matrices that a file states, by their keys."""
    return tuple(
        NamedPose(target, frame, documents.flat_pose(matrix.data, f"{source}: {key}"))
        for key, matrix in matrices.items()
        if matrix is not None
    )


def _raw(name: str, part: Any, first: Any, source: str) -> ParsedCamera[CentralCamera]:
    """Camera before its rectification, on the rectified Camera1."""
    place, size_px = f"{source}: {name}", (part.width, part.height)
    intrinsics, skew_px = base.matrix_intrinsics(size_px, part.K.data, f"{place}.K")
    base.check_no_skew(skew_px, f"{place}.K")
    with error_context(place):
        lens = base.brown_pinhole(intrinsics, part.D.data, f"{place}.D")
        on_first = base.rectified_pose(part.R.data, part.P.data, place)
    stated = first.fx, first.cx, first.fy, first.cy
    same = np.allclose([part.P.data[at] for at in (0, 2, 5, 6)], stated)
    notes = () if same else (f"{name}.P: expected fx, cx, fy, cy of Camera, as ORB-SLAM3 does",)
    return ParsedCamera(name, lens, (NamedPose(NAMES[0], name, on_first),), notes=notes)


def _matrix(key: str, matrix: Floats) -> str:
    """Matrix of 32-bit floats, as ORB-SLAM3 takes it."""
    text = base.yaml_matrix(key, 4, 4, matrix.ravel().tolist(), opencv=True)
    return text.replace("dt: d", "dt: f")
