"""JSON Schemas of files: what omnisim reads is valid, and mistakes of one key are found."""

import json
import tomllib
from pathlib import Path

import pytest

import omnisim
from omnisim.apps.cli.checks.requests import SchemaRequest
from omnisim.apps.cli.checks.schema import FILES, file_schema
from omnisim.apps.cli.options import request_fields
from omnisim.core.package_files import SCENES

jsonschema = pytest.importorskip("jsonschema")
PACKAGE = Path(omnisim.__file__).parent
ROOT = PACKAGE.parent
SAMPLES = [
    *(("robot", path) for path in sorted(SCENES.glob("*/robot.toml"))),
    *(("scene", path) for path in sorted(SCENES.glob("*/scene.toml"))),
    *(("sensor", path) for path in sorted(SCENES.glob("*/omnicam.toml"))),
    *(("sweep", path) for path in sorted((PACKAGE / "evaluation/sweeps").glob("*.toml"))),
    *(("optics", path) for path in sorted((ROOT / "examples/optics").glob("*.toml"))),
    *(("plan", path) for path in [ROOT / "examples/plan.toml"] if path.is_file()),
]
LIDAR = {"type": "lidar", "name": "a", "position_m": [0.0, 0.0, 1.0]}
SURFACE = {"shape": "sphere", "radius_m": 0.1, "position_m": [0.0, 0.0, 0.2]}


def _faults(kind, table):
    return list(jsonschema.Draft202012Validator(file_schema(kind)).iter_errors(table))


def test_each_kind_has_a_schema():
    (field,) = request_fields(SchemaRequest)
    assert field.choices == tuple(FILES)
    for kind in FILES:
        schema = file_schema(kind)
        jsonschema.Draft202012Validator.check_schema(schema)
        assert json.loads(json.dumps(schema, allow_nan=False)) == schema


@pytest.mark.parametrize(("kind", "path"), SAMPLES, ids=lambda one: getattr(one, "stem", one))
def test_files_that_omnisim_reads_are_valid(kind, path):
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    assert not _faults(kind, json.loads(json.dumps(table, default=str)))


@pytest.mark.parametrize(
    ("kind", "table"),
    [
        ("robot", {"name": "a", "odometry": {"turn_tick_deg": -1.0}}),
        ("robot", {"name": "a", "odometry": {"turn_tick_rad": 0.1}}),
        ("robot", {"name": "a", "sensors": [LIDAR | {"firings": 3}]}),
        ("sensor", {"mirror": {"k": 1.5}}),
        ("sensor", {"degradation": {"noise": {"bit_depth": 17}}}),
        ("sensor", {"lens": {"model": "eucm", "alpha": 2.0}}),
        ("sensor", {"optics": {"surfaces": [SURFACE | {"radius_m": "1"}]}}),
        ("optics", {"camera": {}, "surfaces": [SURFACE | {"radius_m": "1"}]}),
        ("scene", {"file": "a.obj", "lamps": [{"kind": "torch", "intensity": 1.0}]}),
        ("measure", {"noise": {"flat": 3}}),
    ],
)
def test_mistakes_are_found(kind, table):
    assert _faults(kind, table)


def test_keys_have_their_help_and_usual_range():
    schema = file_schema("sensor")
    noise = schema["$defs"]["DegradationTable"]["$defs"]["NoiseTable"]["properties"]
    assert noise["read_noise_e"]["description"] == (
        "Standard deviation in electrons; typically 2 (good CMOS) to 20 (interline CCD)."
    )
