"""Registry of the calibration file formats."""

from __future__ import annotations

import itertools
import re
import tomllib
from collections.abc import Iterator
from typing import Any

from omnisim.cameras.calibration.documents import ForeignTable
from omnisim.cameras.calibration.formats.basalt import Basalt
from omnisim.cameras.calibration.formats.blender_osl import BlenderOsl
from omnisim.cameras.calibration.formats.camodocal import Camodocal
from omnisim.cameras.calibration.formats.colmap import Colmap
from omnisim.cameras.calibration.formats.devices import Aria, Insta360
from omnisim.cameras.calibration.formats.format import Format
from omnisim.cameras.calibration.formats.gazebo import Gazebo
from omnisim.cameras.calibration.formats.gyroflow import Gyroflow
from omnisim.cameras.calibration.formats.isaac import Isaac
from omnisim.cameras.calibration.formats.kalibr import Euroc, Kalibr
from omnisim.cameras.calibration.formats.metashape import Metashape
from omnisim.cameras.calibration.formats.nerfstudio import Nerfstudio
from omnisim.cameras.calibration.formats.nurec import Nurec
from omnisim.cameras.calibration.formats.ocamcalib import Matlab, Ocamcalib
from omnisim.cameras.calibration.formats.omnisim_json import OmnisimJson
from omnisim.cameras.calibration.formats.opencv import OpencvFisheye, OpencvOmnidir, OpencvPinhole
from omnisim.cameras.calibration.formats.orbslam3 import OrbSlam3
from omnisim.cameras.calibration.formats.photogrammetry import Openmvg, Opensfm
from omnisim.cameras.calibration.formats.ros import Foxglove, Ros
from omnisim.cameras.calibration.formats.woodscape import Woodscape
from omnisim.core.errors import CalibrationError, did_you_mean

# In the order in which the signatures are tried.
FORMATS: dict[str, Format[Any]] = {
    form.name: form
    for form in (
        OmnisimJson(), Euroc(), Kalibr(), Camodocal(), OrbSlam3(), OpencvOmnidir(), OpencvFisheye(),
        OpencvPinhole(), Ros(), Opensfm(), Openmvg(), Metashape(), Aria(), Insta360(), Basalt(),
        Woodscape(), Nerfstudio(), Gyroflow(), Foxglove(), Matlab(), Ocamcalib(), Colmap(),
        Gazebo(), Isaac(), BlenderOsl(), Nurec(),
    )
}  # fmt: skip


_AS_OPENCV = "write its numbers as an opencv_fisheye or opencv_pinhole file, in pixels"
_AS_SCENE = "pass it as the scene"
# Files of other tools that are recognized, but not read: name, signature, and the remedy.
FOREIGN_FILES = (
    ("MATLAB's calibration", r"^[ \t]*(fc|KK)[ \t]*=[ \t]*\[", _AS_OPENCV),
    (
        "an IMU's parameters",
        r"^[ \t]*(accelerometer_noise_density|gyroscope_noise_density|gyr_n|acc_n)[ \t]*:",
        "pass the file of the cameras beside it",
    ),
    ("Basalt's settings", r'"config\.\w+"\s*:', "pass the calibration beside them"),
    ("a headset's calibration (Windows Mixed Reality)", r'"ModelParameters"\s*:', _AS_OPENCV),
    ("KITTI's calib_cam_to_cam.txt", r"^(K_00|P_rect_00|P0):", _AS_OPENCV),
    ("Kalibr's report", r"aslam_cv|^Camera-system parameters", "pass the camchain.yaml beside it"),
    ("Kalibr's target", r"^target_type\s*:", "pass it as --board"),
    ("COLMAP's images.txt", r"IMAGE_ID, QW, QX", "pass the cameras.txt beside it"),
    ("a glTF scene", r'\A\s*\{(?s:.*)"asset"\s*:', _AS_SCENE),
    ("a USD scene", r"\A#usda", _AS_SCENE),
    ("an OBJ scene", r"^(mtllib|v [-\d.e]+ [-\d.e]+ [-\d.e]+)", _AS_SCENE),
    ("a scene or a robot", r"<(robot|mujoco|sdf|COLLADA)\b", _AS_SCENE),
)  # fmt: skip

# Tools by their marks in files: format ("": any), tool, pattern. Others are those of the title.
TOOLS = (
    ("", "omnisim", r"^# omnisim \{|<!-- omnisim \{|\"omnisim(_calibration)?\"\s*:"),
    ("kalibr", "OpenVINS", r"^\s*T_imu_cam\s*:"),
    ("euroc", "EuRoC's data set", r"^sensor_type\s*:|^T_BS\s*:"),
    ("kitti360", "KITTI-360", r"^camera_name\s*:\s*[\"']?image_0\d"),
    ("kitti360", "VINS-Fusion", r"^(body_T_cam\d|extrinsicRotation|estimate_extrinsic)\s*:"),
    ("opencv", "OpenCV's calibration sample", r"^calibration_time\s*:"),
    ("ros", "ros2 topic echo", r"^header\s*:"),
    ("ros", "ROS's camera_calibration", r"^camera_name\s*:"),
    ("nerfstudio", "instant-ngp's colmap2nerf", r'"aabb_scale"\s*:'),
    ("nerfstudio", "nerfstudio's ns-process-data", r'"(applied_transform|ply_file_path)"\s*:'),
)  # fmt: skip
SHOWN_FORMATS = 3  # in the message about an unknown file
_KINDS = {".json": "JSON", ".yaml": "YAML", ".sdf": "XML", ".xml": "XML"}


def format_named(name: str) -> Format[Any]:
    """Format with the given name.

    Raises:
        CalibrationError: the name is unknown.
    """
    if name not in FORMATS:
        raise CalibrationError(f"format {name!r}: {did_you_mean(name.lower(), FORMATS)}")
    return FORMATS[name]


def detect_format(text: str, source: str, name: str | None = None) -> Format[Any]:
    """Detect the format of a text: the named one, or the first whose signature matches.

    Raises:
        CalibrationError: the name is unknown, no signature matches, or another format's does.
    """
    alike = (form for form in FORMATS.values() if form.looks_like(text))
    candidates = [*alike] if name is not None else [*itertools.islice(alike, 1)]
    if name is None and not candidates:
        for tool, signature, remedy in FOREIGN_FILES:
            if re.search(signature, text, re.M):
                raise CalibrationError(f"{source}: this is {tool}: {remedy}")
    if name is None:
        if candidates:
            reason = candidates[0].ambiguity(text, source)
            if reason is not None:
                raise CalibrationError(f"{source}: {reason}")
            return candidates[0]
        if _is_sensor_file(text):
            raise CalibrationError(
                f"{source}: this looks like a sensor file: pass --sensor {source}"
            )
        nearest = "".join(f"; not {name}: {reason}" for name, reason in _nearest_formats(text))
        raise CalibrationError(
            f"{source}: expected a calibration in one of the formats {', '.join(FORMATS)}{nearest}"
        )
    form = format_named(name)
    # the name that the user gives tells OpenCV's three formats apart
    foreign = [candidate for candidate in candidates if _family(candidate) != _family(form)]
    if foreign and not form.looks_like(text) and len(foreign) == len(candidates):
        raise CalibrationError(
            f"{source}: this looks like a {foreign[0].name} file ({foreign[0].title}): "
            f"pass --format {foreign[0].name}"
        )
    return form


def tool_of(form: Format[Any], text: str) -> str:
    """Name of the tool that a file of a format is from, as far as its keys tell."""
    for name, tool, mark in TOOLS:
        if name in ("", form.name, _family(form)) and re.search(mark, text, re.M):
            return tool
    return form.title.partition(":")[0].replace(" and ", " or ")


def _nearest_formats(text: str) -> list[tuple[str, str]]:
    """Formats that share most keys with a text, the nearest first, each with one thing it lacks."""
    kind = {"{": "JSON", "<": "XML"}.get(text.lstrip()[:1], "YAML")
    pattern = (
        r"<(\w+)" if kind == "XML" else r"""(?:^|[{,])[- \t]*["']?([A-Za-z_][\w.]*)["']?\s*:"""
    )
    present = set(re.findall(pattern, text, re.M))
    ranked = []
    for form in FORMATS.values():
        keys = {key: needed for table in form.tables for key, needed in _keys_of(table)}
        shared = present & {key.rpartition("/")[2] if kind == "XML" else key for key in keys}
        own_kind = _KINDS.get(form.suffix, "text")
        signature = getattr(form, "signature", re.compile("!!opencv-matrix"))
        signs = re.findall(r"(?:!!)?[a-z][\w-]{3,}", signature.pattern)
        missing = [key for key, is_needed in keys.items() if is_needed and key not in present]
        missing += [sign for sign in signs if sign not in text]
        reason = f"no {missing[0]}" if missing else f"not as in {form.title}"
        reason = reason if kind == own_kind else f"{kind}, not {own_kind}"
        if shared:
            ranked.append((-len(shared), kind != own_kind, len(missing), form, reason))
    own_most = min((count for count, is_other, *_ in ranked if not is_other), default=0)
    ranked = [entry for entry in ranked if not entry[1] or entry[0] < min(2 * own_most, -1)]
    ranked.sort(key=lambda entry: entry[:3])
    nearest = dict.fromkeys((_family(form), reason) for *_, form, reason in ranked)
    return list(nearest)[:SHOWN_FORMATS]


def _keys_of(table: type[ForeignTable]) -> Iterator[tuple[str, bool]]:
    """Keys that a table and the tables in it read, and whether each is required."""
    for name, field in table.model_fields.items():
        yield field.alias or name, field.is_required()
    for key in table.also_read:
        yield key, False
    for inner in table.inner.values():
        if inner is not table:
            yield from _keys_of(inner)


def _is_sensor_file(text: str) -> bool:
    try:
        return bool({"lens", "mirror", "virtual_cameras", "extends"} & tomllib.loads(text).keys())
    except (tomllib.TOMLDecodeError, RecursionError):
        return False


def _family(form: Format[Any]) -> str:
    return form.name.partition("_")[0]
