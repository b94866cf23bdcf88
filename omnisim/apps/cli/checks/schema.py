"""`omnisim schema`: JSON Schemas of omnisim's TOML files, by which editors check their keys.

They follow from the classes that read the files. Rules between keys are left to omnisim.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from omnisim.apps.cli.checks.requests import SchemaRequest
from omnisim.apps.cli.console import out
from omnisim.core.files.file_keys import json_schema
from omnisim.core.files.parameters import Table, table_of

Json = dict[str, Any]
# Class of each kind of file; a function makes that of a plan of measurements.
FILES = {
    "robot": "omnisim.robots.robot_file:RobotFile",
    "sensor": "omnisim.rendering.camera.sensor_file:SensorFile",
    "scene": "omnisim.scene.files.scene_file:SceneFile",
    "plan": "omnisim.datasets.generate.plan:Plan",
    "optics": "omnisim.cameras.optics.system_file:OpticsFile",
    "sweep": "omnisim.evaluation.sweep_plan:SweepPlan",
    "measure": "omnisim.apps.cli.measure.measure_plan:plan_schema",
}


def file_schema(kind: str) -> Json:
    """JSON Schema of a kind of file, one of `FILES`."""
    module, _, name = FILES[kind].partition(":")
    found: type[Table] | Callable[[], type[Table]] = getattr(import_module(module), name)
    schema: Json = json_schema(found if isinstance(found, type) else found())
    defs: Json = schema.setdefault("$defs", {})
    if kind == "robot":
        from omnisim.sensors.sensor_registry import SENSOR_TYPES

        schema["properties"]["sensors"]["items"] = _by_kind("type", SENSOR_TYPES, defs)
    elif kind == "sensor":
        from omnisim.cameras.optics.system_file import OpticsFile
        from omnisim.rendering.camera.degradations.degradation_file import degradation_table

        schema["properties"]["degradation"] = _part(degradation_table(), defs)
        from omnisim.cameras import CAMERA_MODELS

        cameras = {name: table_of(model) for name, model in CAMERA_MODELS.items()}
        defs["LensTable"] |= _by_kind("model", cameras, defs)
        keys = {"properties": _part(OpticsFile, defs)["properties"]}
        defs["OpticsTable"] |= {"if": {"required": ["surfaces"]}, "then": keys}
    if kind in ("sensor", "optics"):
        from omnisim.cameras.optics.system_file import shape_schemas

        parts = defs if kind == "optics" else defs["OpticsFile"]["$defs"]
        parts["OpticalSurfaceTable"] |= _by_kind("shape", shape_schemas(), defs)
    return schema


def _by_kind(key: str, kinds: Mapping[str, type[Table]], defs: Json) -> Json:
    """Rules of a table whose key names its kind, which adds keys of its own."""
    rules = [
        {
            "if": {"properties": {key: {"const": name}}, "required": [key]},
            "then": {"properties": _part(table, defs)["properties"]},
        }
        for name, table in kinds.items()
    ]
    return {"type": "object", "allOf": rules}


def _part(table: type[Table], defs: Json) -> Json:
    """Schema of a table in a file; what it refers to is added to the file's definitions."""
    schema: Json = json_schema(table, f"{table.__name__}/$defs/")
    del schema["$schema"]
    defs[table.__name__] = {"$defs": schema.pop("$defs", {})} | defs.get(table.__name__, {})
    return schema


def run(request: SchemaRequest) -> None:
    """Print the JSON Schema of a kind of file."""
    out.print(json.dumps(file_schema(request.file), indent=2, ensure_ascii=False))
