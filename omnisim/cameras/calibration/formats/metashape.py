"""Metashape's XML: one <calibration>, or a project's <document>, which is read only.

| projection or type | model |
| --- | --- |
| frame | unified with ξ = 0, fitted with k4 |
| fisheye, equidistant_fisheye | kannala_brandt, fitted with p1, p2, b2 |
| equisolid_fisheye | equisolid, fitted with coefficients |
| spherical | equirectangular of 2 : 1 |

fx = f + b1, fy = f, the skew is b2; p1 and p2 are OpenCV's p2 and p1; cx and cy count from the
image's center. A project has <sensors> and <cameras>: a camera's pose is in its chunk, and the
chunk's transform leads to the world; a slave sensor has its rotation and location in its master's
frame. PhotoScan before 1.2 had other parameters.

Source: Metashape's manual, "Camera models"; its scripts; files of its users.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    EquirectangularCamera,
    EquisolidCamera,
    KannalaBrandtCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import WORLD, NamedPose
from omnisim.cameras.calibration.documents import ForeignTable, Unread, parse, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats import photogrammetry as solved
from omnisim.cameras.calibration.formats.format import Intrinsics, ParsedCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError
from omnisim.core.files.parameters import Number

PROJECTIONS = {
    "frame": "perspective", "fisheye": "fisheye", "equidistant_fisheye": "fisheye",
    "equisolid_fisheye": "equisolid", "spherical": "spherical",
}  # fmt: skip


class _Resolution(ForeignTable):
    width: documents.Size
    height: documents.Size


class _Calibration(
    ForeignTable,
    inner={"resolution": _Resolution},
    unread={
        "p3 p4": Unread("higher tangential terms: align again without them", (), True),
        "fx fy skew": Unread("a file of PhotoScan before 1.2: export it again", (), True),
        "corrections": Unread("corrections beside the lens's formula"),
    },
    harmless="date class covariance",
):
    projection: str | None = None
    type: str | None = None
    width: documents.Size | None = None
    height: documents.Size | None = None
    resolution: _Resolution | None = None
    f: Number | None = None
    cx: Number = 0.0
    cy: Number = 0.0
    b1: Number = 0.0
    b2: Number = 0.0
    k1: Number = 0.0
    k2: Number = 0.0
    k3: Number = 0.0
    k4: Number = 0.0
    p1: Number = 0.0
    p2: Number = 0.0


class _File(ForeignTable, inner={"calibration": _Calibration}):
    @classmethod
    def reads(cls, key: str, value: Any) -> bool:
        return key == "document" or super().reads(key, value)


class Metashape(solved.SolvedFormat):
    """Format of Metashape's calibrations."""

    name = "metashape"
    title = "Metashape: calibration xml"
    suffix = ".xml"
    models = (UnifiedCamera, KannalaBrandtCamera, EquisolidCamera, EquirectangularCamera)
    fits = ((KannalaBrandtCamera, base.ANY), (UnifiedCamera, base.PINHOLE))
    signature = re.compile(r"<calibration>\s*<projection>|<document version(?s:.*)<sensors\b")
    metadata_place = base.MetadataPlace.XML
    several = has_names = False
    tables = (_File,)
    unified_terms = frozenset({"k3", "skew"})

    def document(self, text: str, source: str) -> Any:
        """Elements and attributes by name; lists of equal ones."""
        root = documents.parse_xml(text, source)
        return {root.tag: _tree(root)}

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera, or the calibrated sensors of a project's chunks."""
        place = f"{source}: calibration"
        if "calibration" in document:
            return [ParsedCamera("camera", _lens(document["calibration"], place))]
        cameras = []
        for chunk in _items(document, "document", "chunk"):
            to_world, scale = np.eye(4), 1.0
            for transform in _items(chunk, "transform"):
                to_world = _rotation_and(transform, "translation", f"{source}: transform")
                scale = float((*_numbers(transform, "scale", source), 1.0)[0])
            sensors = _items(chunk, "sensors", "sensor")
            labels = [str(sensor.get("label", "sensor")) for sensor in sensors]
            keys = [str(sensor.get("id")) for sensor in sensors]
            names = {
                key: label if labels.count(label) == 1 else f"{label} {key}"
                for key, label in zip(keys, labels, strict=True)
            }
            shots = _items(chunk, "cameras", "camera") + _items(chunk, "cameras", "group", "camera")
            for own, sensor in zip(keys, sensors, strict=True):
                master = str(sensor.get("master_id"))
                found = sorted(
                    _items(sensor, "calibration"), key=lambda one: one.get("class") != "adjusted"
                )
                poses = []
                if master in names and master != own:
                    at = _rotation_and(sensor, "location", f"{place}: {names[own]}")
                    poses.append(NamedPose(names[master], names[own], at))
                for shot in (shot for shot in shots if str(shot.get("sensor_id")) == own):
                    numbers = _numbers(shot, "transform", source)
                    if numbers:
                        where = f"{source}: camera {shot.get('label')}: transform"
                        if len(numbers) != 16:
                            raise unexpected(where, "16 numbers", numbers)
                        at = documents.pose(np.reshape(numbers, (4, 4)).tolist(), where)
                        at[:3, 3] *= scale
                        poses.append(NamedPose(WORLD, str(shot.get("label")), to_world @ at))
                if found:
                    where = f"{place}: {names[own]}"
                    lens, notes = (
                        _lens(found[0], where),
                        self.notices({"calibration": found[0]}, where),
                    )
                    for shown in _items(sensor, "property"):
                        if shown.get("name") == "rolling_shutter" and shown.get("value") == "true":
                            notes.append(
                                f"rolling_shutter = true: {documents.ROLLING_SHUTTER.effect}"
                            )
                    cameras.append(ParsedCamera(names[own], lens, tuple(poses), notes=tuple(notes)))
        return cameras

    def encode(self, cameras: Sequence[ParsedCamera[solved.SolvedLens]]) -> str:
        """Text of a file with the camera."""
        ((lens, (projection, values, skew)),) = (
            (one.lens, solved.terms_of(one.lens)) for one in cameras
        )
        if isinstance(lens, EquisolidCamera):
            fx = fy = lens.focal_length_px
        elif isinstance(lens, EquirectangularCamera):
            fx = fy = 0.5 * lens.width_px / math.pi
        else:
            fx, fy = lens.focal_lengths_px
        u, v = lens.principal_point_px
        center = {"cx": u - 0.5 * (lens.width_px - 1), "cy": v - 0.5 * (lens.height_px - 1)}
        names = {"p1": "p2", "p2": "p1"}
        terms = {names.get(name, name): value for name, value in values.items()}
        numbers = {"f": fy, **center, "b1": fx - fy, "b2": skew, **terms}
        kind = next(kind for kind, same in PROJECTIONS.items() if same == projection)
        lines = {"projection": kind, "width": lens.width_px, "height": lens.height_px}
        lines |= {name: repr(float(value)) for name, value in numbers.items() if value}
        body = "".join(f"  <{name}>{value}</{name}>\n" for name, value in lines.items())
        return f'<?xml version="1.0" encoding="UTF-8"?>\n<calibration>\n{body}</calibration>\n'


def _tree(element: Element) -> Any:
    """Attributes and children of an element by name, or its number or text."""
    fields: dict[str, Any] = {name: _value(text) for name, text in element.attrib.items()}
    for tag in dict.fromkeys(child.tag for child in element):
        children = [_tree(child) for child in element if child.tag == tag]
        fields[tag] = children if len(children) > 1 else children[0]
    text = _value(element.text or "")
    return (
        {**fields, "text": text} if fields and not len(element) and text != "" else fields or text
    )


def _value(text: str) -> float | str:
    try:
        number = float(text)
    except ValueError:
        return text.strip()
    return number if math.isfinite(number) else text


def _items(node: Any, *path: str) -> list[dict[str, Any]]:
    """Tables below a node, by the names that lead to them."""
    nodes = [node]
    for tag in path:
        found = [one[tag] for one in nodes if isinstance(one, dict) and tag in one]
        nodes = [one for items in found for one in (items if isinstance(items, list) else [items])]
    return [one for one in nodes if isinstance(one, dict)]


def _numbers(node: Mapping[str, Any], tag: str, place: str) -> list[float]:
    """Numbers in an element's text; none without it."""
    text = node.get(tag, "")
    text = text.get("text", "") if isinstance(text, dict) else text
    return [documents.parse_number(word, f"{place}: {tag}") for word in str(text).split()]


def _rotation_and(node: Mapping[str, Any], position: str, place: str) -> Floats:
    """Pose (4, 4) from an element's rotation and position; the identity if they are missing."""
    turn = _numbers(node, "rotation", place) or np.eye(3).ravel().tolist()
    at = documents.counted(_numbers(node, position, place) or [0.0] * 3, "x y z", place)
    rows = np.reshape(documents.counted(turn, " ".join("r" * 9), f"{place}: rotation"), (3, 3))
    return documents.pose(np.column_stack((rows, at)).tolist(), place)


def _lens(fields: Any, place: str) -> CentralCamera:
    part = parse(fields, _Calibration, place)
    kind = part.projection or part.type or "frame"
    documents.check_choice(kind, PROJECTIONS, f"{place}: projection")
    if part.type not in (None, kind):
        raise unexpected(f"{place}: type", f"{kind}, as projection", part.type)
    stated = part.resolution or part
    for side in ("width", "height"):
        if getattr(part, side) not in (None, getattr(stated, side)):
            expected = f"{getattr(stated, side)}, as resolution"
            raise unexpected(f"{place}: {side}", expected, getattr(part, side))
    if stated.width is None or stated.height is None:
        raise CalibrationError(f"{place}: width, height: missing")
    size = stated.width, stated.height
    if kind == "spherical":
        return solved.panorama(size, place)
    if part.f is None:
        raise CalibrationError(
            f"{place}: f: missing: a file of PhotoScan before 1.2? Export it again"
        )
    center = part.cx + 0.5 * (size[0] - 1), part.cy + 0.5 * (size[1] - 1)
    values = {name: getattr(part, name) for name in solved.K[:4]} | {"p1": part.p2, "p2": part.p1}
    with base.error_context(place):
        intrinsics = Intrinsics(*size, (part.f + part.b1, part.f), center)
        return solved.lens_from_terms(intrinsics, PROJECTIONS[kind], values, part.b2)
