"""Gazebo's cameras in SDF: `<camera>` with `<horizontal_fov>`, `<image>` and perhaps `<lens>`.

| type | r = c1 f fun(θ/c2 + c3) | here |
| --- | --- | --- |
| no lens, gnomonical | f tan θ | perspective |
| stereographic | 2 f tan(θ/2) | stereographic |
| equidistant | f θ | equidistant |
| equisolid_angle | 2 f sin(θ/2) | equisolid |
| orthographic | f sin θ | orthographic |
| custom | by `<custom_function>` | gazebo |

Radii are counted in half widths of the picture. With `scale_to_hfov` f follows from
`horizontal_fov`: its half reaches the left and right edges; without, f is the custom function's.
`cutoff_angle` is θ_max. The axis is in the picture's middle; `<intrinsics>`, which pinhole cameras
may have, count pixels from the first one's corner.

Source: SDFormat's specification, camera/lens; Gazebo's wide-angle camera.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

from omnisim.calibration.documents import parse_xml
from omnisim.calibration.fields import LARGEST_SIZE_PX, short
from omnisim.calibration.formats.format import Format, Remarks, Said, making
from omnisim.calibration.formats.pinholes import pinhole
from omnisim.cameras import (
    CentralCamera,
    EquidistantCamera,
    EquisolidCamera,
    GazeboCamera,
    OrthographicCamera,
    PerspectiveCamera,
    StereographicCamera,
)
from omnisim.errors import CalibrationError

# class, c1, c2, fun
TYPES: dict[str, tuple[type[Any], float, float, str]] = {
    "gnomonical": (PerspectiveCamera, 1.0, 1.0, "tan"),
    "stereographic": (StereographicCamera, 2.0, 2.0, "tan"),
    "equidistant": (EquidistantCamera, 1.0, 1.0, "id"),
    "equisolid_angle": (EquisolidCamera, 2.0, 2.0, "sin"),
    "orthographic": (OrthographicCamera, 1.0, 1.0, "sin"),
}
FUNCTIONS = {"sin": math.sin, "tan": math.tan, "id": float}
DEFAULT_CUTOFF_RAD = 1.5707
CORNER_PX = 0.5  # from the first pixel's corner to its centre


def _looks_like(text: str) -> bool:
    return text.lstrip().startswith("<") and bool(re.search(r"<(lens|horizontal_fov)\b", text))


def _read(text: str, source: str) -> list[Said]:
    root = parse_xml(text, source)
    parents = {child: parent for parent in root.iter() for child in parent}
    cameras = [one for one in root.iter("camera") if one.find("horizontal_fov") is not None]
    if not cameras:
        raise CalibrationError(f"{source}: no <camera> with a <horizontal_fov>")
    said = []
    for name, camera in zip(_names(cameras, parents), cameras, strict=True):
        place = f"{source}: {name}"
        with making(place):
            said.append(Said(name, _lens(camera, place)))
    return said


def _names(
    cameras: Sequence[ElementTree.Element], parents: Mapping[ElementTree.Element, Any]
) -> list[str]:
    """Different names: the cameras' own, their sensors', or numbers where both are not enough."""
    if len(cameras) == 1:
        sensor = parents.get(cameras[0], cameras[0])
        return [cameras[0].get("name") or sensor.get("name") or "camera"]
    for elements in (cameras, [parents.get(camera, camera) for camera in cameras]):
        names = [element.get("name") for element in elements]
        if all(names) and len(set(names)) == len(names):
            return [str(name) for name in names]
    return [f"camera{index}" for index in range(len(cameras))]


def _lens(camera: ElementTree.Element, place: str) -> CentralCamera:
    size = _size(camera, "image/width", place), _size(camera, "image/height", place)
    fov = _number(camera, "horizontal_fov", None, place)
    if not 0.0 < fov <= 2.0 * math.pi + 1e-5:
        raise CalibrationError(f"{place}: horizontal_fov = {fov:g}: want more than 0, at most 2π")
    middle = 0.5 * (size[0] - 1), 0.5 * (size[1] - 1)
    for key in ("k1", "k2", "k3", "p1", "p2"):
        bend = _number(camera, f"distortion/{key}", 0.0, place)
        if bend:
            raise CalibrationError(
                f"{place}: distortion/{key} = {bend:g}: want 0: it bends the picture after the lens"
            )
    lens = camera.find("lens")
    kind = (lens.findtext("type") or "").strip() if lens is not None else "gnomonical"
    if lens is None or kind in ("", "gnomonical"):
        return _pinhole(camera, size, fov, middle, place)
    cutoff = _number(camera, "lens/cutoff_angle", DEFAULT_CUTOFF_RAD, place)
    cutoff = min(cutoff, math.pi)
    scaled = _truth(lens, "scale_to_hfov", place)
    if kind == "custom":
        function = (camera.findtext("lens/custom_function/fun") or "tan").strip()
        if function not in FUNCTIONS:
            raise CalibrationError(f"{place}: fun = {function!r}: want sin, tan or id")
        c1, c2, c3, f = (
            _number(camera, f"lens/custom_function/{key}", default, place)
            for key, default in (("c1", 1.0), ("c2", 1.0), ("c3", 0.0), ("f", 1.0))
        )
        focal = 0.5 * size[0] * (_scaled_focal(fov, c1, c2, c3, function, place) if scaled else f)
        return GazeboCamera(*size, focal, middle, c1, c2, c3, function, cutoff)
    if kind not in TYPES:
        wanted = ", ".join((*TYPES, "custom"))
        raise CalibrationError(f"{place}: lens/type = {kind!r}: want one of {wanted}")
    model, c1, c2, function = TYPES[kind]
    half = _scaled_focal(fov, c1, c2, 0.0, function, place) if scaled else 1.0
    largest = getattr(model, "largest_theta_rad", math.pi)
    return model(*size, 0.5 * size[0] * half, middle, min(cutoff, largest))


def _scaled_focal(fov: float, c1: float, c2: float, c3: float, function: str, place: str) -> float:
    """f with which half the field of view reaches the edge, in half widths."""
    if c2 == 0.0:
        raise CalibrationError(f"{place}: c2 = 0: want > 0")
    reach = c1 * FUNCTIONS[function](0.5 * fov / c2 + c3)
    if not 1e-9 < reach < 1e9:
        raise CalibrationError(
            f"{place}: horizontal_fov = {fov:g}: this lens does not reach the picture's edge there"
        )
    return 1.0 / reach


def _pinhole(
    camera: ElementTree.Element,
    size: tuple[int, int],
    fov: float,
    middle: tuple[float, float],
    place: str,
) -> CentralCamera:
    if camera.find("lens/intrinsics") is not None:
        fx, fy, cx, cy, skew = (
            _number(camera, f"lens/intrinsics/{key}", default, place)
            for key, default in (("fx", None), ("fy", None), ("cx", None), ("cy", None), ("s", 0.0))
        )
        return pinhole(size, (fx, fy), (cx - CORNER_PX, cy - CORNER_PX), skew_px=skew)
    if fov >= math.pi:
        raise CalibrationError(
            f"{place}: horizontal_fov = {fov:g}: want less than π of a camera without a wide lens"
        )
    return PerspectiveCamera(*size, 0.5 * size[0] / math.tan(0.5 * fov), middle)


def _number(camera: ElementTree.Element, path: str, default: float | None, place: str) -> float:
    text = camera.findtext(path)
    if text is None:
        if default is None:
            raise CalibrationError(f"{place}: {path}: missing")
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CalibrationError(f"{place}: {path} = {short(text.strip())}: want a number")
    return value


def _size(camera: ElementTree.Element, path: str, place: str) -> int:
    value = _number(camera, path, None, place)
    if not (1 <= value <= LARGEST_SIZE_PX and value == int(value)):
        raise CalibrationError(f"{place}: {path} = {value:g}: want 1 to {LARGEST_SIZE_PX}")
    return int(value)


def _truth(lens: ElementTree.Element, path: str, place: str) -> bool:
    text = (lens.findtext(path) or "true").strip().lower()
    if text not in ("true", "1", "false", "0"):
        raise CalibrationError(f"{place}: lens/{path} = {text!r}: want true or false")
    return text in ("true", "1")


def _write(cameras: Sequence[Said]) -> str:
    (camera,) = cameras
    lens: Any = camera.lens
    half = 0.5 * lens.width_px
    if isinstance(lens, PerspectiveCamera):
        fov, inner = 2.0 * math.atan(half / lens.focal_length_px), _intrinsics(lens)
    else:
        seen = lens.ray_from_pixel((lens.width_px - 0.5, lens.principal_point_px[1])).directions
        fov = 2.0 * math.atan2(math.hypot(seen[0], seen[1]), seen[2])
        inner = f"""        <type>custom</type>
        <custom_function>
          <c1>{lens.c1!r}</c1>
          <c2>{lens.c2!r}</c2>
          <c3>{lens.c3!r}</c3>
          <f>{lens.focal_length_px / half!r}</f>
          <fun>{lens.function}</fun>
        </custom_function>
        <scale_to_hfov>false</scale_to_hfov>
        <cutoff_angle>{lens.theta_edge_rad!r}</cutoff_angle>
"""
    name = ElementTree.Element("camera", name=camera.name)
    opening = ElementTree.tostring(name, encoding="unicode").replace(" />", ">")
    sensor = "camera" if isinstance(lens, PerspectiveCamera) else "wideanglecamera"
    return f"""<?xml version="1.0"?>
<sdf version="1.9">
  <sensor name="camera" type="{sensor}">
    {opening}
      <horizontal_fov>{fov!r}</horizontal_fov>
      <image>
        <width>{lens.width_px}</width>
        <height>{lens.height_px}</height>
      </image>
      <lens>
{inner}      </lens>
    </camera>
  </sensor>
</sdf>
"""


def _intrinsics(lens: PerspectiveCamera) -> str:
    u, v = lens.principal_point_px
    focal = lens.focal_length_px
    return f"""        <type>gnomonical</type>
        <scale_to_hfov>false</scale_to_hfov>
        <intrinsics>
          <fx>{focal!r}</fx>
          <fy>{focal!r}</fy>
          <cx>{u + CORNER_PX!r}</cx>
          <cy>{v + CORNER_PX!r}</cy>
          <s>0</s>
        </intrinsics>
"""


def _refuse(lens: Any) -> str | None:
    if isinstance(lens, PerspectiveCamera):
        return None
    u, v = lens.principal_point_px
    off_u, off_v = u - 0.5 * (lens.width_px - 1), v - 0.5 * (lens.height_px - 1)
    off = math.hypot(off_u, off_v)
    if off > 1e-9:
        return f"its axis is in the picture's middle, this one's {off:.3g} px beside it"
    return None


GAZEBO = Format(
    "gazebo",
    "Gazebo: SDF camera with lens",
    ".sdf",
    _looks_like,
    _read,
    _write,
    (PerspectiveCamera, GazeboCamera),
    ((GazeboCamera, {}),),
    _refuse,
    Remarks.XML,
    centred=True,
)
