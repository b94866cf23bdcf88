"""Calibrations that devices carry: Project Aria's JSON, and Insta360's string `offset_v3`.

Aria's cameras have one focal length f, or two with KannalaBrandtK3. `T_Device_Camera` maps the
camera to the device, and a camera's time less `TimeOffsetSec_Device_Camera` is the device's. The
size, the largest angle (`MaxSolidAngle`) and the radius of the image circle are in `ConfigData`;
without it, those of the device's cameras apply. If no pose is known, the first camera stands in for
the device, and an omnisim key says so.

Insta360's string has its numbers between underscores: the count of lenses, for each lens

    ξ fx fy cx cy yaw pitch roll tx ty tz k1 k2 k3 p1 p2 width height type

and one more. A lens is `cv2.omnidir`'s with k3. The size is of both images side by side if it is
2 : 1, else of one; cx counts from the left end of the first image. The second lens looks back, half
a turn about the image's v axis, from (tx, ty, tz) meters in the first one's frame. Public sources
do not show how yaw, pitch and roll turn a lens: they are named in a note.

In both, pixel (0, 0) is the center of the first pixel, as in omnisim.

Source: projectaria_tools, calibration; telemetry-parser and Gyroflow, for Insta360; strings of the
X4 and the X5, and a measured pose of the X5's second lens, that their users publish.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    KannalaBrandtCamera,
    ThinPrismFisheyeCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import WORLD, NamedPose, find_pose
from omnisim.cameras.calibration.documents import ForeignTable, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.basalt import POSES_UNKNOWN
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.files.parameters import Flag, Number
from omnisim.core.poses import pose_from_rotation

DEVICE = "device"
PARAMETERS = {
    "FisheyeRadTanThinPrism": "f cu cv k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3",
    "Fisheye62": "f cu cv k0 k1 k2 k3 k4 k5 p0 p1", "KannalaBrandtK3": "fx fy cx cy k0 k1 k2 k3",
}  # fmt: skip
# Width, height, largest angle and radius of the image circle of devices' cameras: Aria of the first
# generation, and of the second (Oatmeal).
CONFIGS: dict[str, dict[str, tuple[int, int, float, float | None]]] = {
    "Aria": {
        "camera-slam": (640, 480, 1.4, 330.0), "camera-rgb": (2880, 2880, 1.0, 1415.0),
        "camera-et": (640, 480, 0.75, None),
    },
    "Oatmeal": {
        "slam": (512, 512, 1.4, 300.0), "camera-rgb": (4032, 3024, 1.4, 2202.0),
        "camera-et": (400, 400, 0.75, None),
    },
}  # fmt: skip
AriaLens = ThinPrismFisheyeCamera | KannalaBrandtCamera


class _Projection(ForeignTable, harmless="Description"):
    Name: str
    Params: documents.Numbers


class _Transform(ForeignTable):
    Translation: documents.Numbers
    UnitQuaternion: tuple[Number, documents.Numbers]


class _Config(ForeignTable):
    ImageWidth: documents.Size
    ImageHeight: documents.Size
    MaxSolidAngle: Number
    ValidRadius: Number | None = None


class _Camera(
    ForeignTable,
    inner={"Projection": _Projection, "T_Device_Camera": _Transform, "ConfigData": _Config},
    harmless="SerialNumber",
):
    Label: str
    Calibrated: Flag = True
    Projection: _Projection
    T_Device_Camera: _Transform
    TimeOffsetSec_Device_Camera: Number = 0.0
    ConfigData: _Config | None = None


class _Device(ForeignTable, harmless="BuildVersion"):
    DeviceClass: str = "Aria"


class _File(
    ForeignTable,
    inner={"CameraCalibrations": _Camera, "DeviceClassInfo": _Device},
    also_read=POSES_UNKNOWN,
    unread={"ReadoutTimesSec": documents.ROLLING_SHUTTER},
    harmless="AlgorithmName AlgorithmVersion CalibrationSource Serial FileFormat ImuCalibrations "
    "OriginSpecification MagCalibrations BaroCalibrations MicCalibrations utc_timestamp_ns "
    "tracking_timestamp_us",
):
    CameraCalibrations: list[_Camera]
    DeviceClassInfo: _Device = _Device()
    ImageSizes: list[tuple[documents.Size, documents.Size]] | None = None


class Aria(Format[AriaLens]):
    """Format of Project Aria's devices."""

    name = "aria"
    title = "Project Aria: calibration json"
    suffix = ".json"
    models = (ThinPrismFisheyeCamera, KannalaBrandtCamera)
    fits = (
        (ThinPrismFisheyeCamera, {"focal_lengths_px": None}),
        (KannalaBrandtCamera, ANY),
    )
    signature = re.compile(r'"(CameraCalibrations|T_Device_Camera)"\s*:')
    metadata_place = base.MetadataPlace.KEY
    caveat = "projectaria's own projection ends at 90°"
    several = True
    tables = (_File,)

    def document(self, text: str, source: str) -> Any:
        """Content of a file; refuses the lines of an online_calibration.jsonl."""
        lines = len(re.findall(r"^\{", text, re.M))
        if lines > 1:
            raise unexpected(source, "one calibration: keep one line of these", f"{lines} of them")
        return super().document(text, source)

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the cameras."""
        file = parse(document, _File, source)
        cameras = []
        for index, part in enumerate(file.CameraCalibrations):
            place = f"{source}: {part.Label}"
            lens = self._lens(part, file, index, place)
            poses: tuple[NamedPose, ...] = ()
            if document.get(POSES_UNKNOWN) is not True:
                at, where = part.T_Device_Camera, f"{place}: T_Device_Camera"
                w, imaginary = at.UnitQuaternion
                x, y, z = documents.counted(imaginary, "x y z", f"{where}: UnitQuaternion")
                position = documents.counted(at.Translation, "x y z", where)
                matrix = base.pose_from_quaternion(position, (x, y, z, w), where)
                poses = (NamedPose(DEVICE, part.Label, matrix),)
            notes = _size_notes(part, file, index)
            if not part.Calibrated:
                notes = ("Calibrated = false: it was not calibrated", *notes)
            shift_s = -part.TimeOffsetSec_Device_Camera
            cameras.append(ParsedCamera(part.Label, lens, poses, shift_s, notes))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[AriaLens]]) -> str:
        """Text of a file with the cameras on one device."""
        poses = [pose for camera in cameras for pose in camera.poses if pose.target != WORLD]
        names = [camera.name for camera in cameras]
        frames = [frame for pose in poses for frame in (pose.target, pose.source)]
        body = next((frame for frame in frames if frame not in names), names[0])
        entries = []
        for camera in cameras:
            lens, (u, v) = camera.lens, camera.lens.principal_point_px
            (fx, fy), pose = lens.focal_lengths_px, find_pose(poses, body, camera.name)
            position, (x, y, z, w) = base.position_and_quaternion(
                np.eye(4) if pose is None else pose
            )
            params, model = [fx, fy, u, v, *lens.coefficients], "KannalaBrandtK3"
            if isinstance(lens, ThinPrismFisheyeCamera):
                params = [fx, u, v, *lens.coefficients, *lens.tangential, *lens.prism]
                model = "FisheyeRadTanThinPrism"
            entry: dict[str, Any] = {
                "Calibrated": True, "Label": camera.name, "SerialNumber": "",
                "T_Device_Camera": {"Translation": position, "UnitQuaternion": [w, [x, y, z]]},
                "Projection": {"Description": PARAMETERS[model], "Name": model, "Params": params},
                "ConfigData": {"ImageWidth": lens.width_px, "ImageHeight": lens.height_px,
                               "MaxSolidAngle": lens.theta_max_rad},
            }  # fmt: skip
            if camera.time_shift_s:
                entry["TimeOffsetSec_Device_Camera"] = -camera.time_shift_s
            entries.append(entry)
        data: dict[str, Any] = {
            "DeviceClassInfo": {"BuildVersion": "", "DeviceClass": "Aria"},
            "OriginSpecification": {"Type": "Custom", "ChildLabel": names[0]},
            "CameraCalibrations": entries,
        }
        if not poses:
            data[POSES_UNKNOWN] = True
        return json.dumps(data, indent=2) + "\n"

    def unsupported(self, lens: AriaLens) -> str | None:
        """Rejects thin prism fisheyes with two focal lengths."""
        fx, fy = lens.focal_lengths_px
        if isinstance(lens, ThinPrismFisheyeCamera) and fx != fy:
            return "it has one focal length"
        return super().unsupported(lens)

    def _lens(self, part: _Camera, file: _File, index: int, place: str) -> CentralCamera:
        model, where = part.Projection.Name, f"{place}: Projection"
        documents.check_choice(model, PARAMETERS, f"{where}: Name")
        names = PARAMETERS[model]
        values = documents.counted(part.Projection.Params, names, f"{where}: Params")
        configs = CONFIGS.get(file.DeviceClassInfo.DeviceClass, CONFIGS["Aria"])
        known = next((one for label, one in configs.items() if part.Label.startswith(label)), None)
        if part.ConfigData is not None:
            width, height, widest, radius = (value for _, value in part.ConfigData)
        elif known is not None:
            width, height, widest, radius = known
        else:
            raise unexpected(f"{place}: ConfigData", "the size of an unknown camera", None)
        if part.ConfigData is None and file.ImageSizes and index < len(file.ImageSizes):
            radius = radius and radius * file.ImageSizes[index][0] / width
            width, height = file.ImageSizes[index]
        with error_context(place):
            lens: AriaLens
            if model == "KannalaBrandtK3":
                fx, fy, u, v, *k = values
                lens = KannalaBrandtCamera(width, height, (fx, fy), (u, v), tuple(k))
            else:
                f, u, v, *k = values
                terms = tuple(k[:6]), tuple(k[6:8]), (*k[8:], 0.0, 0.0, 0.0, 0.0)[:4]
                lens = ThinPrismFisheyeCamera(width, height, (f, f), (u, v), *terms)
            if radius is not None and radius > 0.0:
                ray = lens.ray_from_pixel((u + radius, v)).directions
                widest = min(widest, math.atan2(math.hypot(ray[0], ray[1]), ray[2]))
            return lens.ending_at(min(widest, math.pi)) or lens


def _size_notes(part: _Camera, file: _File, index: int) -> tuple[str, ...]:
    """Notes on sizes that contradict each other or are not known."""
    config, sizes = part.ConfigData, file.ImageSizes or []
    device = file.DeviceClassInfo.DeviceClass
    if config is None:
        known = f"DeviceClass = {device}: an unknown device, of which size and circle are as Aria's"
        return () if device in CONFIGS else (known,)
    size = config.ImageWidth, config.ImageHeight
    if index >= len(sizes) or sizes[index] == size:
        return ()
    ours, theirs = (f"{width} × {height}" for width, height in (size, sizes[index]))
    return (f"ImageSizes states {theirs}, and ConfigData {ours}, which is read",)


LENS = "xi fx fy cx cy yaw pitch roll tx ty tz k1 k2 k3 p1 p2 width height type"
HALF_TURN = np.diag([-1.0, 1.0, -1.0])
TURNS_UNKNOWN = (
    "yaw, pitch, roll = {} are not read: public sources do not show how they turn the lens"
)


class Insta360(Format[UnifiedCamera]):
    """Format of Insta360's string for two fisheyes."""

    name = "insta360"
    title = "Insta360: offset_v3"
    suffix = ".txt"
    models = (UnifiedCamera,)
    fits = ((UnifiedCamera, base.NO_SKEW),)
    signature = re.compile(r"\A\s*[\"']?\d(_-?[\d.]+(e[-+]?\d+)?){9,}[\"']?\s*(#|\Z)")
    several = True
    unified_terms = frozenset({"ξ", "k3"})

    def read(self, document: str, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the lenses."""
        words = document.partition("#")[0].strip("\"' \r\n\t").split("_")
        numbers = [documents.parse_number(word, source) for word in words]
        count, names = int(numbers[0]), LENS.split()
        expected = 2 + count * len(names)
        if len(numbers) != expected:
            got = f"{len(numbers)}: offset and offset_v2 have other models"
            raise unexpected(source, f"offset_v3, {expected} numbers of {count} lenses", got)
        cameras: list[ParsedCamera[CentralCamera]] = []
        for index in range(count):
            values = numbers[1 + index * len(names) :][: len(names)]
            part = dict(zip(names, values, strict=True))
            place = f"{source}: lens{index}"
            side, height = (
                documents.parse_size(str(part[key]), place) for key in ("width", "height")
            )
            width = side // 2 if side == 2 * height else side
            u = part["cx"] - index * width if part["cx"] > width else part["cx"]
            distortion = tuple(part[key] for key in ("k1", "k2", "p1", "p2", "k3"))
            with error_context(place):
                center = u, part["cy"]
                focal = part["fx"], part["fy"]
                lens = UnifiedCamera(width, height, focal, center, part["xi"], distortion)
            poses: tuple[NamedPose, ...] = ()
            if index:
                position = [part[key] for key in ("tx", "ty", "tz")]
                back = pose_from_rotation(HALF_TURN, position)
                poses = (NamedPose("lens0", f"lens{index}", back),)
            turns = ", ".join(f"{part[key]:g}°" for key in ("yaw", "pitch", "roll"))
            notes = (TURNS_UNKNOWN.format(turns),) if any(values[5:8]) else ()
            cameras.append(ParsedCamera(f"lens{index}", lens, poses, notes=notes))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[UnifiedCamera]]) -> str:
        """Text of a file with the lenses, each in an image of its own size."""
        poses, words = [pose for camera in cameras for pose in camera.poses], [str(len(cameras))]
        for index, camera in enumerate(cameras):
            lens, (u, v) = camera.lens, camera.lens.principal_point_px
            pose = find_pose(poses, cameras[0].name, camera.name)
            position = [0.0] * 3 if pose is None else pose[:3, 3].tolist()
            k1, k2, p1, p2 = lens.distortion[:4]
            is_square = lens.width_px == lens.height_px
            numbers = (
                lens.xi, *lens.focal_lengths_px, u + index * lens.width_px, v, 0.0, 0.0, 0.0,
                *position, k1, k2, lens.k3, p1, p2,
            )  # fmt: skip
            words += [repr(float(number)) for number in numbers]
            words += [str(lens.width_px * (1 + is_square)), str(lens.height_px), "113"]
        return "_".join((*words, "197632")) + "\n"

    def camera_name(self, index: int, name: str) -> str:
        """Name made from the index alone."""
        return f"lens{index}"
