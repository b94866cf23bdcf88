"""Controls for a camera's parameters, generated from the schemas of its files."""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, get_args, get_origin

import pydantic

from omnisim.apps.live.camera_document import LIGHT, SENSOR, SIZE, SIZES_PX, CameraDocument
from omnisim.cameras import CAMERA_MODELS, HyperbolicCamera
from omnisim.cameras.optics.surface import Rod
from omnisim.cameras.optics.system_file import (
    OpticalSurfaceTable,
    OpticsFile,
    SystemCameraTable,
    shape_schemas,
)
from omnisim.core.files.file_keys import Limit, keys_of, summary
from omnisim.core.files.parameters import Table, Typical, table_of
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.sensor_file import CameraTable, MirrorTable, VirtualCamerasTable
from omnisim.rendering.sensor import MountingTable
from omnisim.scene import Scene
from omnisim.scene.light.light_tables import FogTable, LightTable, SkyTable
from omnisim.scene.light.lighting import is_even

Json = dict[str, Any]
OPTICS = f"{SENSOR}.optics"
_QUALITY = ("quality", "supersampling")  # keys of [camera] that apply to every camera
_UNITS = (
    ("_mps2", "m/s²"), ("_mps", "m/s"), ("_deg", "°"), ("_px", "px"), ("_m", "m"), ("_s", "s"),
    ("_e_per_s", "e⁻/s"), ("_e", "e⁻"), ("_db", "dB"), ("_ev", "EV"), ("_k", "K"),
)  # fmt: skip
_MISALIGNED = {"decenter_m": 0.02, "tilt_deg": 15.0}  # slider ranges, to either side of 0
_NUMBERS = 12  # maximum length of a list with a field per number


class _ValueType(NamedTuple):
    """Type of a control's value: number, choice, vector, …; with choices and a vector's length."""

    name: str
    choices: tuple[Any, ...] = ()
    length: int = 0


def control_groups(
    document: CameraDocument, camera: OmniCamera, scene: Scene | None = None
) -> list[Json]:
    """Groups of controls for a camera, as JSON-serializable values; groups contain subgroups.

    Args:
        document: document with the explicit values.
        camera: camera of the document; gives the values of keys that are missing or "auto".
        scene: scene of the document, for the controls of its light; None: no such controls.
    """
    groups: list[Json] = []
    own = "mirror"
    if "optics" in document.sensor:
        own = "optics"
        groups += _optics_groups(document)
    elif "lens" in document.sensor:
        own = "lens"
        groups.append(_lens_group(document, f"{SENSOR}.lens", "Lens"))
    else:
        path = f"{SENSOR}.mirror"
        groups.append(_group("Mirror", "", _keys(document, path, MirrorTable)))
    names = None if own == "mirror" else _QUALITY
    path = f"{SENSOR}.camera"
    groups.append(_group("Camera", "", _keys(document, path, CameraTable, names)))
    for title, path, table in (
        ("Mounting", f"{SENSOR}.{own}.mounting", MountingTable),
        ("Virtual cameras", f"{SENSOR}.virtual_cameras", VirtualCamerasTable),
    ):
        groups.append(_group(title, summary(table), _keys(document, path, table)))
    effects = _group("Degradation", "Effects in the order in which light meets them.", [])
    for name, effect in EFFECTS.items():
        path = f"{SENSOR}.degradation.{name}"
        given = document.value(path)
        is_on = isinstance(given, Mapping) and bool(given.get("enabled", True))
        keys = _keys(document, path, table_of(effect)) if is_on else []
        title = name.replace("_", " ").capitalize()
        effects["groups"].append(_group(title, summary(effect), keys, switch=path, on=is_on))
    groups = [*groups, effects]
    effective = CameraDocument.of_camera(camera)
    if isinstance(model := camera.model, HyperbolicCamera):
        for key, value in (
            ("mirror.rim_radius_m", float(model.mirror.rim_radius_m)),
            ("mirror.polygons", camera.mesh_polygons),
            ("camera.focal_length_px", float(model.focal_length_px)),
            ("camera.principal_point_px", [float(px) for px in model.principal_point_px]),
        ):
            effective = effective.with_value(f"{SENSOR}.{key}", value)
    short_px = min(camera.model.width_px, camera.model.height_px)
    effective = effective.with_value(SIZE, short_px)
    if scene is not None:
        groups += _light_groups(document, scene)
        exposure, ambient = float(scene.lighting.exposure), map(float, scene.lighting.ambient)
        effective = effective.with_value(f"{LIGHT}.light.exposure", exposure)
        effective = effective.with_value(f"{LIGHT}.light.ambient", list(ambient))
        shadows = any(light.casts_shadow for light in scene.lighting.lights)
        effective = effective.with_value(f"{LIGHT}.light.shadows", shadows)
    for control in [control for group in groups for control in group["controls"]]:
        value = _plain(effective.value(control["path"]))
        control["effective"] = value
        if control["value"] is None and not isinstance(control["default"], int | float | list):
            low, high = (
                None if control[side] is None else Limit(control[side], control[f"{side}_open"])
                for side in ("low", "high")
            )
            control["soft"] = _soft(control | {"value": value, "default": None}, low, high)
    return groups


def _group(title: str, help_text: str, controls: list[Json], **more: Any) -> Json:
    return {"title": title, "help": help_text, "controls": controls, "groups": [], **more}


def _light_groups(document: CameraDocument, scene: Scene) -> list[Json]:
    """Groups of a scene's light, sky and fog, with the keys of a scene's TOML."""
    about = summary(LightTable)
    if scene.lighting.baked is not None:
        about = "Baked light. Setting a value of light or sky replaces it with lamps and sky."
    elif is_even(scene.lighting):
        about = "Even light, without shadows: the scene has no lamps."
    keys = ("exposure", "ambient", "shadows", "shading")
    groups = [_group("Light", about, _keys(document, f"{LIGHT}.light", LightTable, keys))]
    tables: tuple[tuple[str, type[Table], tuple[str, ...]], ...] = (
        ("Sky", SkyTable, ("brightness", "turbidity", "sun_elevation_deg", "sun_azimuth_deg")),
        ("Fog", FogTable, ("color", "visibility_m")),
    )
    for title, table, names in tables:
        path = f"{LIGHT}.{title.lower()}"
        is_on = document.value(path) is not None
        controls = _keys(document, path, table, names) if is_on else []
        groups.append(_group(title, summary(table), controls, switch=path, on=is_on))
    return groups


def _optics_groups(document: CameraDocument) -> Iterator[Json]:
    names = ("medium", "looking", "origin_m", "color")
    keys = _keys(document, OPTICS, OpticsFile, names)
    yield _group("Optical system", summary(OpticsFile), keys)
    path = f"{OPTICS}.camera"
    lens = _lens_group(document, path, "Lens")
    placed = "position_m", "decenter_m", "tilt_deg"
    lens["controls"] += _keys(document, path, SystemCameraTable, placed)
    yield lens
    shapes = shape_schemas()
    for number, surface in enumerate(document.value(f"{OPTICS}.surfaces") or ()):
        path, shape = f"{OPTICS}.surfaces.{number}", surface.get("shape")
        keys = _keys(document, path, shapes[shape]) if shape in shapes else []
        own = _keys(document, path, OpticalSurfaceTable)
        keys += [control for control in own if control["label"] not in ("name", "shape")]
        name = surface.get("name") or shape
        kind = "mirror" if surface.get("medium") is None else "boundary"
        yield _group(f"Surface {number}: {name}", f"A {kind}.", keys)
    for number, rod in enumerate(document.value(f"{OPTICS}.obstacles") or ()):
        path = f"{OPTICS}.obstacles.{number}"
        keys = _keys(document, path, table_of(Rod))
        keys = [control for control in keys if control["label"] != "name"]
        yield _group(f"Obstacle: {rod.get('name', number)}", summary(Rod), keys)


def _lens_group(document: CameraDocument, path: str, title: str) -> Json:
    table = document.value(path) or {}
    model = str(table.get("model"))
    if model not in CAMERA_MODELS:
        return _group(title, f"Camera of {table.get('calibration', 'a calibration file')}.", [])
    kind = CAMERA_MODELS[model]
    kinds = _ValueType("choice", tuple(CAMERA_MODELS))
    choice = _control(f"{path}.model", "model", kinds, model, None)
    choice["help"] = "Camera model. A newly chosen model starts with example parameters."
    choice["required"] = True
    shapes = [key.inner.model for key in keys_of(table_of(kind)) if key.inner]  # such as a mirror's
    tables = (table_of(kind), *shapes)
    controls = [control for table_ in tables for control in _keys(document, path, table_)]
    return _group(title, summary(kind), [choice, *controls])


def _keys(
    document: CameraDocument,
    path: str,
    model: type[pydantic.BaseModel],
    names: tuple[str, ...] | None = None,
) -> list[Json]:
    """Controls of a table's keys, or of those named, without those of nested tables."""
    controls = []
    for key in keys_of(model):
        at, default = f"{path}.{key.name}", key.default
        kind = _kind(key.field.annotation)
        values = document.value(at) or default
        if kind is None and isinstance(values, list | tuple) and 0 < len(values) <= _NUMBERS:
            are_numbers = all(isinstance(value, int | float) for value in values)
            kind = _ValueType("vector", length=len(values)) if are_numbers else None
        if kind is None or key.inner or (names is not None and key.name not in names):
            continue
        control = _control(at, key.name, kind, document.value(at), default)
        for side, limit in (("low", key.low), ("high", key.high)):
            if limit is not None:
                control |= {side: limit.value, f"{side}_open": limit.is_open}
        control["help"] = key.help
        control["soft"] = _soft(control, key.low, key.high, key.typical)
        controls.append(control)
    return controls


def _control(path: str, name: str, kind: _ValueType, value: Any, default: Any) -> Json:
    return {
        "path": path,
        "label": name,
        "kind": kind.name,
        "choices": list(kind.choices),
        "length": kind.length,
        "unit": next((unit for suffix, unit in _UNITS if name.endswith(suffix)), ""),
        "value": _plain(value),
        "default": _plain(default),
        "low": None,
        "high": None,
        "low_open": False,
        "high_open": False,
        "help": "",
        "required": False,
        "soft": None,
    }


def _plain(value: Any) -> Any:
    """Convert a value to JSON; infinity becomes a string."""
    if isinstance(value, float) and not math.isfinite(value):
        return "inf" if value > 0.0 else "-inf"
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def _kind(annotation: Any) -> _ValueType | None:
    """Type of the values of a type annotation; None: a table, or a type without a control."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is typing.Annotated:
        return _kind(parts[0])
    if origin is typing.Literal:
        return _ValueType("choice", parts)
    if origin in (typing.Union, types.UnionType):
        kinds = [kind for part in parts if part is not type(None) and (kind := _kind(part))]
        choices = tuple(word for kind in kinds for word in kind.choices)
        others = [kind for kind in kinds if kind.name != "choice"]
        if not others:
            return _ValueType("choice", choices) if choices else None
        return others[0]._replace(choices=choices)
    if origin is tuple and parts and parts[-1] is not Ellipsis:
        return _ValueType("vector", length=len(parts)) if _kind(parts[0]) else None
    names = {float: "number", int: "integer", bool: "boolean", str: "text"}
    return _ValueType(names[annotation]) if annotation in names else None


def _soft(
    control: Json, low: Limit | None, high: Limit | None, typical: Typical | None = None
) -> Json | None:
    """Range of a slider: typical values, or the limits if they are close; None: no slider."""
    if control["kind"] not in ("number", "integer", "vector"):
        return None
    if typical is not None:
        return _range(typical.low, typical.high, False)
    if low is not None and high is not None and high.value - low.value <= 400.0:
        return _range(low.value, high.value, False)
    base = control["value"] if control["default"] in (None, "inf") else control["default"]
    numbers = base if isinstance(base, list) else [base]
    largest = max((abs(x) for x in numbers if isinstance(x, int | float)), default=0.0)
    if control["label"] in _MISALIGNED:
        reach = _MISALIGNED[control["label"]]
        return _range(-reach, reach, False)
    if control["unit"] == "°":
        is_opening = control["label"].startswith(("theta", "half_angle"))
        bottom = max(0.0 if is_opening else -180.0, -180.0 if low is None else low.value)
        return _range(bottom, 180.0 if high is None else min(high.value, 180.0), False)
    is_count = control["kind"] == "integer"
    is_positive = (low is not None and low.value >= 0.0) or is_count or control["unit"] == "px"
    if largest == 0.0 and is_count and control["unit"] == "px":
        return _range(*SIZES_PX, True)
    if largest == 0.0:
        return _range(0.0 if is_positive else -1.0, 10.0 if is_count else 1.0, False)
    if is_positive and control["kind"] != "vector":
        bottom = max(largest / 4.0, 0.0 if low is None else low.value)
        top = largest * 4.0 if high is None else min(largest * 4.0, high.value)
        return _range(bottom, top, True)
    return _range(-2.0 * largest, 2.0 * largest, False)


def _range(low: float, high: float, is_log: bool) -> Json:
    return {"low": low, "high": high, "log": is_log and low > 0.0}
