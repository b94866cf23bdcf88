"""Registry of the calibration file formats."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from omnisim.cameras.calibration.formats.basalt import Basalt
from omnisim.cameras.calibration.formats.blender_osl import BlenderOsl
from omnisim.cameras.calibration.formats.camodocal import Camodocal
from omnisim.cameras.calibration.formats.colmap import Colmap
from omnisim.cameras.calibration.formats.format import Format
from omnisim.cameras.calibration.formats.foxglove import Foxglove
from omnisim.cameras.calibration.formats.gazebo import Gazebo
from omnisim.cameras.calibration.formats.gyroflow import Gyroflow
from omnisim.cameras.calibration.formats.isaac import Isaac
from omnisim.cameras.calibration.formats.kalibr import Kalibr
from omnisim.cameras.calibration.formats.nerfstudio import Nerfstudio
from omnisim.cameras.calibration.formats.nurec import Nurec
from omnisim.cameras.calibration.formats.ocamcalib import Ocamcalib
from omnisim.cameras.calibration.formats.omnisim_json import OmnisimJson
from omnisim.cameras.calibration.formats.opencv import OpencvFisheye, OpencvOmnidir, OpencvPinhole
from omnisim.cameras.calibration.formats.ros import Ros
from omnisim.cameras.calibration.formats.woodscape import Woodscape
from omnisim.core.errors import CalibrationError, did_you_mean

# In the order in which the signatures are tried.
FORMATS: dict[str, Format[Any]] = {
    form.name: form
    for form in (
        OmnisimJson(), Kalibr(), Camodocal(), OpencvOmnidir(), OpencvFisheye(), OpencvPinhole(),
        Ros(), Basalt(), Woodscape(), Nerfstudio(), Gyroflow(), Foxglove(), Ocamcalib(), Colmap(),
        Gazebo(), Isaac(), BlenderOsl(), Nurec(),
    )
}  # fmt: skip


_AS_OPENCV = "write its numbers as an opencv_fisheye or opencv_pinhole file, in pixels"
_AS_SCENE = "pass it as the scene"
# Files of other tools that are recognized, but not read: name, signature, and the remedy.
FOREIGN_FILES = (
    ("OpenSfM's camera_models.json", r'"projection_type"\s*:', _AS_OPENCV),
    ("OpenMVG's sfm_data.json", r'"sfm_data_version"\s*:', _AS_OPENCV),
    (
        "Metashape's calibration",
        r"<calibration>\s*<projection>|<document version(?s:.*)<sensors\b",
        "export it by Tools > Camera Calibration, as OpenCV",
    ),
    ("MATLAB's calibration", r"^[ \t]*(fc|KK)[ \t]*=[ \t]*\[", _AS_OPENCV),
    ("ORB-SLAM's settings", r"^[ \t]*Camera1?\.(type|fx)[ \t]*:", _AS_OPENCV),
    ("OpenVINS's settings", r"^relative_config_imucam\s*:", "pass the chain that they name"),
    ("Kalibr's report", r"aslam_cv|^Camera-system parameters", "pass the camchain.yaml beside it"),
    ("Kalibr's target", r"^target_type\s*:", "pass it as --board"),
    ("COLMAP's images.txt", r"IMAGE_ID, QW, QX", "pass the cameras.txt beside it"),
    ("a glTF scene", r'\A\s*\{(?s:.*)"asset"\s*:', _AS_SCENE),
    ("a USD scene", r"\A#usda", _AS_SCENE),
    ("an OBJ scene", r"^(mtllib|v [-\d.e]+ [-\d.e]+ [-\d.e]+)", _AS_SCENE),
    ("a scene or a robot", r"<(robot|mujoco|sdf|COLLADA)\b", _AS_SCENE),
)  # fmt: skip


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
    candidates = [form for form in FORMATS.values() if form.looks_like(text)]
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
        raise CalibrationError(
            f"{source}: expected a calibration in one of the formats {', '.join(FORMATS)}"
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


def _is_sensor_file(text: str) -> bool:
    try:
        return bool({"lens", "mirror", "virtual_cameras", "extends"} & tomllib.loads(text).keys())
    except (tomllib.TOMLDecodeError, RecursionError):
        return False


def _family(form: Format[Any]) -> str:
    return form.name.partition("_")[0]
