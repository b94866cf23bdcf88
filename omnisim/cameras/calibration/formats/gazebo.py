"""Gazebo's cameras in SDF: `<camera>` with `<horizontal_fov>`, `<image>` and an optional `<lens>`.

| type | r = c1 f fun(θ/c2 + c3) | model |
| --- | --- | --- |
| no lens, gnomonical | f tan θ | perspective |
| stereographic | 2 f tan(θ/2) | stereographic |
| equidistant | f θ | equidistant |
| equisolid_angle | 2 f sin(θ/2) | equisolid |
| orthographic | f sin θ | orthographic |
| custom | by `<custom_function>` | gazebo |

Radii are in half widths of the image. With `scale_to_hfov`, f is such that half of `horizontal_fov`
reaches the left and the right edge; without it, f is that of the custom function.
`cutoff_angle` is θ_max. The axis is at the image center. `<intrinsics>`, allowed for pinhole
cameras, counts pixels from the corner of the first pixel.

Source: SDFormat's specification, camera/lens; Gazebo's wide-angle camera.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element, tostring

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    EquidistantCamera,
    EquisolidCamera,
    GazeboCamera,
    OrthographicCamera,
    PerspectiveCamera,
    StereographicCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.documents import ForeignTable, Unread, unexpected
from omnisim.cameras.calibration.equivalents import IDEAL_FISHEYES
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.cameras.models.field_of_view import largest_theta_rad
from omnisim.core.errors import CalibrationError

GazeboFisheye = EquidistantCamera | EquisolidCamera | OrthographicCamera | StereographicCamera
TYPES: Mapping[str, type[GazeboFisheye]] = {
    "stereographic": StereographicCamera,
    "equidistant": EquidistantCamera,
    "equisolid_angle": EquisolidCamera,
    "orthographic": OrthographicCamera,
}
FUNCTIONS = {"sin": math.sin, "tan": math.tan, "id": float}
MAX_DEPTH = 4  # of elements in a camera
FOV_TOLERANCE_RAD = 1e-3  # between horizontal_fov and intrinsics
DEFAULT_CUTOFF_RAD = 1.5707
CORNER_PX = 0.5  # from the first pixel's corner to its center
GazeboLens = PerspectiveCamera | GazeboCamera


class UnsupportedLensError(CalibrationError):
    """Error for a valid lens that omnisim has no model for."""


class _Camera(
    ForeignTable,
    also_read=(
        "horizontal_fov image/width image/height distortion/k1 distortion/k2 distortion/k3 "
        "distortion/p1 distortion/p2 lens/type lens/scale_to_hfov lens/cutoff_angle "
        "lens/custom_function/c1 lens/custom_function/c2 lens/custom_function/c3 "
        "lens/custom_function/f lens/custom_function/fun lens/intrinsics/fx lens/intrinsics/fy "
        "lens/intrinsics/cx lens/intrinsics/cy lens/intrinsics/s"
    ),
    unread={
        "image/format": Unread("images are RGB", ("R8G8B8", "RGB_INT8", "B8G8R8", "BGR_INT8")),
        "clip/near clip/far": Unread("near_m and far_m of a sensor file"),
        "noise/stddev": Unread("[degradation.noise] of a sensor file"),
        "pose": Unread("mounting of a sensor file"),
    },
    harmless=(
        "image/anti_aliasing distortion/center noise/type noise/mean save/path visibility_mask "
        "optical_frame_id camera_info_topic trigger_topic triggered segmentation_type box_type "
        "lens/env_texture_size lens/projection/p_fx lens/projection/p_fy lens/projection/p_cx "
        "lens/projection/p_cy lens/projection/tx lens/projection/ty"
    ),
):
    """Paths of elements in a `<camera>`."""


class _Cameras(ForeignTable, inner={"*": _Camera}):
    @classmethod
    def reads(cls, key: str, value: Any) -> bool:
        return True


class Gazebo(Format[GazeboLens]):
    """Format of Gazebo's cameras."""

    name = "gazebo"
    title = "Gazebo: SDF camera with lens"
    suffix = ".sdf"
    models = (PerspectiveCamera, GazeboCamera)
    fits = ((GazeboCamera, ANY),)
    signature = re.compile(r"\A\s*(?=<).*<(lens|horizontal_fov)\b", re.S)
    metadata_place = base.MetadataPlace.XML
    centered = True
    tables = (_Cameras,)

    def document(self, text: str, source: str) -> Element:
        """Root element of a file."""
        return documents.parse_xml(text, source)

    def notices(self, document: Element, source: str) -> list[str]:
        """Notes on elements of the cameras that are not read, one sentence each."""
        texts = {name: dict(_texts(element)) for name, element in _elements(document).items()}
        return super().notices(texts, source)

    def read(self, document: Element, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse all cameras that have a field of view."""
        elements = _elements(document)
        if not elements:
            raise unexpected(source, "a <camera> with a <horizontal_fov>", "none")
        cameras = []
        for name, element in elements.items():
            place = f"{source}: {name}"
            with error_context(place):
                lens = read_lens(element, place)
                cameras.append(ParsedCamera(name, lens, notes=_contradictions(element, lens)))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[GazeboLens]]) -> str:
        """Text of a world with the camera."""
        (camera,) = cameras
        lens = camera.lens
        half = 0.5 * lens.width_px
        if isinstance(lens, PerspectiveCamera):
            sensor, fov = "camera", 2.0 * math.atan(half / lens.focal_length_px)
            focal, (u, v) = lens.focal_length_px, lens.principal_point_px
            inner = f"""        <type>gnomonical</type>
        <scale_to_hfov>false</scale_to_hfov>
        <intrinsics>
          <fx>{focal!r}</fx>
          <fy>{focal!r}</fy>
          <cx>{u + CORNER_PX!r}</cx>
          <cy>{v + CORNER_PX!r}</cy>
          <s>0</s>
        </intrinsics>
"""
        else:
            sensor, inner = (
                "wideanglecamera",
                f"""        <type>custom</type>
        <custom_function>
          <c1>{lens.c1!r}</c1>
          <c2>{lens.c2!r}</c2>
          <c3>{lens.c3!r}</c3>
          <f>{lens.focal_length_px / half!r}</f>
          <fun>{lens.function}</fun>
        </custom_function>
        <scale_to_hfov>false</scale_to_hfov>
        <cutoff_angle>{lens.theta_edge_rad!r}</cutoff_angle>
""",
            )
            edge = lens.ray_from_pixel((lens.width_px - 0.5, lens.principal_point_px[1])).directions
            fov = 2.0 * math.atan2(math.hypot(edge[0], edge[1]), edge[2])
        element = Element("camera", name=camera.name)
        opening = tostring(element, encoding="unicode").replace(" />", ">")
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

    def unsupported(self, lens: GazeboLens) -> str | None:
        """Rejects a wide lens whose axis is not at the image center."""
        if isinstance(lens, PerspectiveCamera):
            return None
        u, v = lens.principal_point_px
        off_u, off_v = u - 0.5 * (lens.width_px - 1), v - 0.5 * (lens.height_px - 1)
        off = math.hypot(off_u, off_v)
        if off > 1e-9:
            return f"its axis is at the image center, this lens's is {off:.3g} px off"
        return None


def _elements(root: Element) -> dict[str, Element]:
    """Elements of the cameras with a field of view, by distinct names."""
    parents = {child: parent for parent in root.iter() for child in parent}
    cameras = [
        camera for camera in root.iter("camera") if camera.find("horizontal_fov") is not None
    ]
    return dict(zip(_names(cameras, parents), cameras, strict=True))


def _texts(element: Element, path: str = "") -> Iterator[tuple[str, str]]:
    """Paths below an element, and their texts."""
    for child in element:
        if len(child) and path.count("/") < MAX_DEPTH:
            yield from _texts(child, f"{path}{child.tag}/")
        else:
            yield f"{path}{child.tag}", (child.text or "").strip()


def _contradictions(camera: Element, lens: CentralCamera) -> tuple[str, ...]:
    """Notes on elements that contradict others, or have no effect beside them."""
    fov, notes = float(camera.findtext("horizontal_fov") or 0.0), []
    if isinstance(lens, PerspectiveCamera | UnifiedCamera):
        # at the center the two models scale alike along u
        ray = lens.ray_from_pixel(np.add(lens.principal_point_px, (1.0, 0.0))).directions
        seen = 2.0 * math.atan(0.5 * lens.width_px * ray[0] / ray[2])
        if abs(seen - fov) > FOV_TOLERANCE_RAD:
            notes.append(f"horizontal_fov = {fov:g} is not read: the intrinsics give {seen:g} rad")
        cutoff = camera.findtext("lens/cutoff_angle")
        if cutoff is not None and float(cutoff) < largest_theta_rad(lens):
            notes.append(f"lens/cutoff_angle = {cutoff.strip()} is not read for a perspective lens")
    elif camera.find("lens/intrinsics") is not None:
        notes.append("lens/intrinsics is not read for a wide-angle lens")
    if camera.find("lens/custom_function") is not None and not isinstance(lens, GazeboCamera):
        notes.append("lens/custom_function is not read for a lens of another type")
    return tuple(notes)


def _names(cameras: Sequence[Element], parents: Mapping[Element, Element]) -> list[str]:
    """Distinct camera names: their own, else those of their sensors, else numbered ones."""
    if len(cameras) == 1:
        sensor = parents.get(cameras[0], cameras[0])
        return [cameras[0].get("name") or sensor.get("name") or "camera"]
    for elements in (cameras, [parents.get(camera, camera) for camera in cameras]):
        names = [element.get("name") for element in elements]
        if all(names) and len(set(names)) == len(names):
            return [str(name) for name in names]
    return [f"camera{index}" for index in range(len(cameras))]


def read_lens(camera: Element, place: str) -> CentralCamera:
    """Lens of a `<camera>`.

    Raises:
        CalibrationError: the lens is invalid; names place, actual and expected value.
    """
    width, height = (
        documents.parse_size(_text(camera, path, place), f"{place}: {path}")
        for path in ("image/width", "image/height")
    )
    size = width, height
    fov = _number(camera, "horizontal_fov", None, place)
    if not 0.0 < fov <= 2.0 * math.pi + 1e-5:
        raise unexpected(f"{place}: horizontal_fov", "more than 0 and at most 2π", fov)
    middle = 0.5 * (size[0] - 1), 0.5 * (size[1] - 1)
    for key in ("k1", "k2", "k3", "p1", "p2"):
        coefficient = _number(camera, f"distortion/{key}", 0.0, place)
        if coefficient:
            expected = "0, as it distorts the image after the lens"
            fault = unexpected(f"{place}: distortion/{key}", expected, coefficient)
            raise UnsupportedLensError(str(fault))
    lens = camera.find("lens")
    kind = (lens.findtext("type") or "").strip() if lens is not None else "gnomonical"
    if lens is None or kind in ("", "gnomonical"):
        return _pinhole(camera, size, fov, middle, place)
    documents.check_choice(kind, ("gnomonical", *TYPES, "custom"), f"{place}: lens/type")
    cutoff = min(_number(camera, "lens/cutoff_angle", DEFAULT_CUTOFF_RAD, place), math.pi)
    flag = (lens.findtext("scale_to_hfov") or "true").strip().lower()
    documents.check_choice(flag, ("true", "1", "false", "0"), f"{place}: lens/scale_to_hfov")
    scaled, half = flag in ("true", "1"), 0.5 * size[0]
    if kind == "custom":
        function = (camera.findtext("lens/custom_function/fun") or "tan").strip()
        documents.check_choice(function, FUNCTIONS, f"{place}: fun")
        c1, c2, c3, f = (
            _number(camera, f"lens/custom_function/{key}", default, place)
            for key, default in (("c1", 1.0), ("c2", 1.0), ("c3", 0.0), ("f", 1.0))
        )
        focal = half * (_focal_from_fov(fov, c1, c2, c3, function, place) if scaled else f)
        return GazeboCamera(*size, focal, middle, c1, c2, c3, function, cutoff)
    model = TYPES[kind]
    c1, c2, function = IDEAL_FISHEYES[model]
    focal = half * (_focal_from_fov(fov, c1, c2, 0.0, function, place) if scaled else 1.0)
    return model(*size, focal, middle, min(cutoff, model.largest_theta_rad))


def _focal_from_fov(
    fov: float, c1: float, c2: float, c3: float, function: str, place: str
) -> float:
    """f in half widths for which half the field of view reaches the image edge."""
    if c2 == 0.0:
        raise unexpected(f"{place}: c2", "more than 0", c2)
    radius = c1 * FUNCTIONS[function](0.5 * fov / c2 + c3)
    if not 1e-9 < radius < 1e9:
        expected = "an angle at which the lens reaches the image's edge"
        raise unexpected(f"{place}: horizontal_fov", expected, fov)
    return 1.0 / radius


def _pinhole(
    camera: Element, size: tuple[int, int], fov: float, middle: tuple[float, float], place: str
) -> CentralCamera:
    if camera.find("lens/intrinsics") is not None:
        fx, fy, cx, cy, skew = (
            _number(camera, f"lens/intrinsics/{key}", default, place)
            for key, default in (("fx", None), ("fy", None), ("cx", None), ("cy", None), ("s", 0.0))
        )
        intrinsics = base.Intrinsics(*size, (fx, fy), (cx - CORNER_PX, cy - CORNER_PX))
        return base.pinhole(intrinsics, skew_px=skew)
    if fov >= math.pi:
        expected = "less than π for a camera without a wide-angle lens"
        raise unexpected(f"{place}: horizontal_fov", expected, fov)
    return PerspectiveCamera(*size, 0.5 * size[0] / math.tan(0.5 * fov), middle)


def _number(camera: Element, path: str, default: float | None, place: str) -> float:
    if default is not None and camera.find(path) is None:
        return default
    return documents.parse_number(_text(camera, path, place), f"{place}: {path}")


def _text(camera: Element, path: str, place: str) -> str:
    text = camera.findtext(path)
    if text is None:
        raise CalibrationError(f"{place}: {path}: missing")
    return text.strip()
