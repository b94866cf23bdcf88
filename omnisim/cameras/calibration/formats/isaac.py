"""Isaac Sim's cameras in USD: Camera prims with a lens distortion schema, as text (.usda).

| model | schema | lens |
| --- | --- | --- |
| ftheta | OmniLensDistortionFthetaAPI | f_theta_inverse, k0 = 0, at most four coefficients |
| opencvFisheye | OmniLensDistortionOpenCvFisheyeAPI | kannala_brandt |
| opencvPinhole | OmniLensDistortionOpenCvPinholeAPI | perspective, unified, rational_polynomial |
| kannalaBrandtK3 | OmniLensDistortionKannalaBrandtK3API | kannala_brandt with k4 = 0, read only |

Attributes are `omni:lensdistortion:MODEL:KEY`. Optical centers count from the corner of the first
pixel: its center is (0.5, 0.5). kannalaBrandtK3 is r = k0 θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ in pixels, as
Newton reads it. Values of attributes that a prim leaves out are the schema's. The file has all
digits; Isaac Sim keeps 32-bit floats, some 1e-4 px.

A pose is the matrix `xformOp:transform` in the parent prim's frame, or in the world. A stage with
references, variants or other layers is a scene, which usd-core reads.

Source: NVIDIA's extension omni.usd.schema.omni_lens_distortion; Newton's USD camera rays.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from textwrap import indent
from typing import Any

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    FThetaInverseCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.calibrated_camera import WORLD, NamedPose
from omnisim.cameras.calibration.documents import ForeignTable, Unread, unexpected
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import ANY, Format, ParsedCamera, error_context
from omnisim.core.errors import CalibrationError

IsaacLens = FThetaInverseCamera | KannalaBrandtCamera | UnifiedCamera | RationalPolynomialCamera
PREFIX = "omni:lensdistortion:"
CENTIMETER = 0.01  # USD's unit, if a stage states none
_SENSOR = {"nominalWidth": 1936.0, "nominalHeight": 1216.0, "opticalCenter": (970.9424, 600.3748)}
_OPENCV = {"imageSize": (2048, 1024), "fx": 900.0, "fy": 800.0, "cx": 1024.0, "cy": 512.0}
_PINHOLE_KEYS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4")
# Models with their attributes and the schema's defaults; None: has to be stated.
ATTRIBUTES: Mapping[str, Mapping[str, Any]] = {
    "ftheta": {**_SENSOR, "maxFov": 200.0, "k0": 0.0, "k1": 0.00245, "k2": 0.0, "k3": 0.0,
               "k4": 0.0},
    "kannalaBrandtK3": {**_SENSOR, "maxFov": 200.0, "k0": None, "k1": 0.0, "k2": 0.0, "k3": 0.0},
    "opencvFisheye": {**_OPENCV, "k1": 0.00245, "k2": 0.0, "k3": 0.0, "k4": 0.0},
    "opencvPinhole": {**_OPENCV, **dict.fromkeys(_PINHOLE_KEYS, 0.0)},
}  # fmt: skip
_OTHERS = {"radTanThinPrism": ": NVIDIA does not state the unit of its k0 … k5", "lut": ""}
SCHEMAS = {
    f"OmniLensDistortion{name[0].upper()}{name[1:]}API".replace("Opencv", "OpenCv"): name
    for name in (*ATTRIBUTES, *_OTHERS)
}
_USD_FROM_OPTICAL = np.diag([1.0, -1.0, -1.0, 1.0])  # USD's cameras look along −z, with y up


def model_of(stated: Any, schemas: Sequence[str]) -> str:
    """Model of a prim's lens, from its model attribute or else its applied schemas; or empty."""
    applied = (SCHEMAS[schema] for schema in schemas if schema in SCHEMAS)
    return str(stated) if stated else next(applied, "")


def lens_of_model(model: str, value: Callable[[str], Any], place: str = "") -> CentralCamera | str:
    """Lens of a model, or the reason why omnisim has none.

    Args:
        model: one of the tokens of `omni:lensdistortion:model`.
        value: returns the value of an attribute of the model by its key, or None.
        place: prefix of messages.

    Raises:
        CalibrationError: an attribute is not a number; names the key.
        OpticsError: numbers of no valid camera.
    """
    if model not in ATTRIBUTES:
        return f"omnisim has no model {model}{_OTHERS.get(model, '')}"
    numbers = {}
    for key, default in ATTRIBUTES[model].items():
        stated = value(key)
        entry = default if stated is None else stated
        several = np.ravel(np.asarray(entry, dtype=object)).tolist()
        expected = "two numbers" if key in ("opticalCenter", "imageSize") else "a number"
        if len(several) != (2 if expected == "two numbers" else 1) or not all(
            isinstance(number, float | int) for number in several
        ):
            raise unexpected(f"{place}{PREFIX}{model}:{key}", expected, stated)
        numbers[key] = tuple(map(float, several))
    if model.startswith("opencv"):
        (width, height), (fx,), (fy,), (cx,), (cy,), *rest = numbers.values()
        terms = [term for (term,) in rest]
        size = base.Intrinsics(int(width), int(height), (fx, fy), (cx - 0.5, cy - 0.5))
        if model == "opencvFisheye":
            return base.fisheye(size, terms, model)
        return base.brown_pinhole(size, terms, model)
    (width,), (height,), (u, v), (field_deg,), *rest = numbers.values()
    k = [term for (term,) in rest]
    where, center = (int(width), int(height)), (u - 0.5, v - 0.5)
    theta_max_rad = min(math.radians(0.5 * field_deg) or math.pi, math.pi)
    if model == "kannalaBrandtK3":
        shares = (k[1] / k[0], k[2] / k[0], k[3] / k[0], 0.0)
        return KannalaBrandtCamera(*where, (k[0], k[0]), center, shares, theta_max_rad)
    if k[0]:
        return f"omnisim has no f-theta lens with k0 = {k[0]:g}"
    while len(k) > 2 and k[-1] == 0.0:
        k.pop()
    return FThetaInverseCamera(*where, center, tuple(k[1:]), theta_max_rad)


class _Prim(
    ForeignTable,
    also_read=f"prim:name prim:parent apiSchemas {PREFIX}model xformOp:transform",
    unread={"xformOp:translate xformOp:orient xformOp:rotateXYZ": Unread("pose of a scene")},
    harmless=(
        "focalLength focusDistance fStop horizontalAperture verticalAperture projection purpose "
        "horizontalApertureOffset verticalApertureOffset clippingRange clippingPlanes visibility "
        "xformOpOrder xformOp:scale"
    ),
):
    """Attributes of a Camera prim, and the names of the prim and of its parent."""


def _table(model: str) -> type[ForeignTable]:
    keys = " ".join(f"{PREFIX}{model}:{key}" for key in ATTRIBUTES.get(model, ()))
    prim = type(model, (_Prim,), {"__module__": __name__}, also_read=keys)
    return type("Stage", (ForeignTable,), {"__module__": __name__}, also_read="metersPerUnit",
                inner={"cameras": prim})  # fmt: skip


TABLES = {model: _table(model) for model in ATTRIBUTES}
_HEAD = re.compile(r'(?:def|over|class)\s+(?:(\w+)\s+)?"([^"]+)"')
_ATTRIBUTE = re.compile(r"(?:custom\s+|uniform\s+)*[\w\[\]]+\s+([\w:]+)\s*=\s*(.+)")
_COMPOSITION = re.compile(r"\b(subLayers|references|payload|inherits|variantSets?|over)\b")


class Isaac(Format[IsaacLens]):
    """Format of Isaac Sim's Camera prims."""

    name = "isaac"
    title = "Isaac Sim: USD cameras"
    suffix = ".usda"
    models = (FThetaInverseCamera, KannalaBrandtCamera, UnifiedCamera, RationalPolynomialCamera)
    fits = (
        (KannalaBrandtCamera, ANY), (UnifiedCamera, base.PINHOLE), (RationalPolynomialCamera, ANY),
    )  # fmt: skip
    signature = re.compile(r"\A#usda(?s:.*)(omni:lensdistortion:|OmniLensDistortion)")
    several = True
    tables = tuple(TABLES.values())
    unified_terms = frozenset({"k3", "thin prism or tilt"})

    def looks_like(self, text: str) -> bool:
        """True for a stage of one layer with a camera of Isaac Sim."""
        return super().looks_like(text) and not _COMPOSITION.search(text)

    def table_of(self, document: Any) -> type[ForeignTable] | None:
        """Schema of a stage, by the model of its first camera."""
        cameras = document["cameras"]
        return TABLES.get(_model(cameras[0])) if cameras else None

    def document(self, text: str, source: str) -> dict[str, Any]:
        """Camera prims of a stage, and its unit."""
        unit = re.search(r"^\s*metersPerUnit\s*=\s*(\S+)", text, re.M)
        meters = documents.parse_number(unit[1], f"{source}: metersPerUnit") if unit else None
        cameras: list[dict[str, Any]] = []
        prims: list[dict[str, Any]] = []  # those that the line is in; empty ones: other braces
        head: dict[str, Any] = {}
        for number, line in enumerate(map(str.strip, text.splitlines()), start=1):
            if found := _HEAD.match(line):
                parent = next((prim["prim:name"] for prim in reversed(prims) if prim), "")
                head = {"type": found[1], "prim:name": found[2], "prim:parent": parent}
            elif found := re.search(r"\bapiSchemas\s*=\s*\[(.*)\]", line):
                head["apiSchemas"] = re.findall(r'"(\w+)"', found[1])
            elif (found := _ATTRIBUTE.fullmatch(line)) and prims and prims[-1]:
                prims[-1][found[1]] = _value(found[2], f"{source}: line {number}")
            if line.endswith("{"):
                prims.append(head if line == "{" or _HEAD.match(line) else {})
                if prims[-1].pop("type", None) == "Camera":
                    cameras.append(prims[-1])
            elif line == "}" and prims:
                prims.pop()
        return {"cameras": cameras} | ({} if meters is None else {"metersPerUnit": meters})

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the camera prims with a lens."""
        parsed = []
        for prim in document["cameras"]:
            name, parent = prim.get("prim:name", "camera"), prim.get("prim:parent") or WORLD
            place = f"{source}: {name}"
            model = _model(prim)
            if not model:
                raise CalibrationError(f"{place}: {PREFIX}model: missing")
            with error_context(place):
                start = f"{PREFIX}{model}:"
                values = {key.removeprefix(start): value for key, value in prim.items()}
                lens = lens_of_model(model, values.get, f"{place}: ")
            if isinstance(lens, str):
                raise CalibrationError(f"{place}: {lens}")
            poses: tuple[NamedPose, ...] = ()
            if "xformOp:transform" in prim:
                where = f"{place}: xformOp:transform"
                matrix = documents.pose(_matrix(prim["xformOp:transform"], where), where)
                matrix[:3, 3] *= document.get("metersPerUnit", CENTIMETER)
                poses = (NamedPose(parent, name, matrix @ _USD_FROM_OPTICAL),)
            parsed.append(ParsedCamera(name, lens, poses))
        return parsed

    def encode(self, cameras: Sequence[ParsedCamera[IsaacLens]]) -> str:
        """Text of a stage with the cameras, below a prim of their body if they have poses."""
        names = [camera.name for camera in cameras]
        body, placed = base.body_poses(cameras)
        parent = self.camera_name(0, body if body not in names else "rig")
        has_parent = body != WORLD and any(pose is not None for pose in placed)
        text = "\n\n".join(map(_prim, cameras, placed))
        if has_parent:
            text = f'def Xform "{parent}"\n{{\n{indent(text, "    ")}\n}}'
        first = parent if has_parent else names[0]
        head = f'    defaultPrim = "{first}"\n    metersPerUnit = 1\n    upAxis = "Z"\n'
        return f"#usda 1.0\n(\n{head})\n\n{text}\n"

    def unsupported(self, lens: IsaacLens) -> str | None:
        """Rejects a skew, a tilt and long f-theta polynomials."""
        if isinstance(lens, FThetaInverseCamera):
            if lens.affine != (1.0, 0.0, 0.0):
                return "its f-theta lens has no affine map"
            long = len(lens.coefficients) > 4
            return "its f-theta lens has four coefficients" if long else None
        if isinstance(lens, RationalPolynomialCamera) and any(lens.tilt_rad):
            return "it has no tilt"
        return super().unsupported(lens)

    def camera_name(self, index: int, name: str) -> str:
        """Name of a prim."""
        word = re.sub(r"\W", "_", name, flags=re.ASCII) or f"cam{index}"
        return f"_{word}" if word[0].isdigit() else word


def _model(prim: Mapping[str, Any]) -> str:
    return model_of(prim.get(f"{PREFIX}model"), prim.get("apiSchemas", ()))


def _value(text: str, place: str) -> Any:
    """Value of an attribute: number, string, list or nested lists."""
    if text.startswith(("@", "<")):  # a path
        return text
    try:
        return json.loads(text.replace("(", "[").replace(")", "]"))
    except (ValueError, RecursionError):
        raise unexpected(place, "a value", text) from None


def _matrix(value: Any, place: str) -> list[list[float]]:
    """Rows of a matrix of USD, which is for row vectors."""
    try:
        return np.asarray(value, dtype=np.float64).reshape(4, 4).T.tolist()
    except (TypeError, ValueError):
        raise unexpected(place, "4 × 4 numbers", value) from None


def _prim(camera: ParsedCamera[IsaacLens], pose: Any) -> str:
    lens = camera.lens
    u, v = (offset + 0.5 for offset in lens.principal_point_px)
    if isinstance(lens, FThetaInverseCamera):
        model, kind = "ftheta", "float2"
        field_deg = 2.0 * math.degrees(lens.theta_max_rad)
        terms = (*lens.coefficients, 0.0, 0.0, 0.0)[:4]
        values = (lens.width_px, lens.height_px, (u, v), field_deg, 0.0, *terms)
    else:
        is_fisheye = isinstance(lens, KannalaBrandtCamera)
        model, kind = ("opencvFisheye" if is_fisheye else "opencvPinhole"), "int2"
        terms = lens.coefficients if isinstance(lens, KannalaBrandtCamera) else lens.distortion
        terms = (*terms, *(0.0,) * 8)[: len(ATTRIBUTES[model]) - len(_OPENCV)]
        values = ((lens.width_px, lens.height_px), *lens.focal_lengths_px, u, v, *terms)
    schema = next(name for name, other in SCHEMAS.items() if other == model)
    lines = [f'token {PREFIX}model = "{model}"']
    for key, value in zip(ATTRIBUTES[model], values, strict=True):
        of = kind if isinstance(value, tuple) else "float"
        lines.append(f"{of} {PREFIX}{model}:{key} = {value!r}")
    if pose is not None:
        rows = documents.rows(np.transpose(pose @ _USD_FROM_OPTICAL))
        matrix = ", ".join(f"({', '.join(map(repr, row))})" for row in rows)
        lines += [f"matrix4d xformOp:transform = ( {matrix} )",
                  'uniform token[] xformOpOrder = ["xformOp:transform"]']  # fmt: skip
    inner = indent("\n".join(lines), "    ")
    head = f'def Camera "{camera.name}" (\n    prepend apiSchemas = ["{schema}"]\n)'
    return f"{head}\n{{\n{inner}\n}}"
