"""Parameters, tables and their TOML: values that fit, and one line for each fault."""

import dataclasses
import math
import tomllib
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field

from omnisim.core.errors import OpticsError, SensorFileError, did_you_mean
from omnisim.core.files import parameters
from omnisim.core.files.file_keys import Limit, json_schema, keys_of
from omnisim.core.files.parameters import (
    NotNegative,
    Number,
    Parameters,
    Positive,
    Table,
    in_degrees,
    overriding,
    parse_table,
    table_of,
)  # fmt: skip
from omnisim.core.files.toml_file import Comment, toml_text
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE


@dataclass(frozen=True)
class Probe(Parameters, name="probe"):
    size_px: Positive = 1.0
    share: parameters.Fraction | None = None
    offset_px: tuple[Number, Number] = (0.0, 0.0)
    mode: Annotated[
        Literal["auto"] | NotNegative, parameters.described("a number ≥ 0 or 'auto'")
    ] = "auto"

    def _check(self):
        if self.share is not None and self.share > self.size_px:
            raise self._error("share", f"at most size_px = {self.size_px:g}")


def test_values_are_normalized():
    probe = Probe(3, np.float32(0.5), [1, np.int64(2)], 0)
    assert probe == Probe(3.0, 0.5, (1.0, 2.0), 0.0)
    assert [type(value) for value in (probe.size_px, probe.share, probe.mode)] == [float] * 3
    assert dataclasses.replace(probe, mode="auto").mode == "auto"


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        ({"size_px": 0.0}, "size_px: expected a number > 0, got 0.0"),
        ({"size_px": np.nan}, "size_px: expected a finite number, got nan"),
        ({"size_px": True}, "size_px: expected a number, got True"),
        ({"offset_px": (1.0, np.inf)}, "offset_px.1: expected a finite number, got inf"),
        ({"mode": "fast"}, "mode: expected a number ≥ 0 or 'auto', got 'fast'"),
        ({"mode": -1.0}, "mode: expected a number ≥ 0 or 'auto', got -1.0"),
    ],
)
def test_constructor_and_file_name_the_same_fault(values, fault):
    with pytest.raises(OpticsError) as caught:
        Probe(**values)
    assert str(caught.value) == f"probe.{fault}"
    with pytest.raises(SensorFileError) as caught:
        parse_table(values, table_of(Probe), SensorFileError, "a.toml", at="probe")
    assert str(caught.value) == f"a.toml: probe.{fault}"


def test_values_that_do_not_fit_each_other_are_refused():
    with pytest.raises(OpticsError, match=r"^probe\.share: expected at most size_px = 0\.2, got 0"):
        Probe(size_px=0.2, share=0.5)


def test_unknown_and_missing_keys():
    class Inner(Table):
        radius_m: Number

    class Outer(Table):
        inner: Inner
        items: tuple[Inner, ...] = ()

    with pytest.raises(SensorFileError) as caught:
        parse_table({"inner": {"radius": 1}, "items": [3]}, Outer, SensorFileError, "a.toml")
    assert str(caught.value).splitlines() == [
        "a.toml: inner.radius_m: missing",
        "a.toml: inner.radius: unknown key; did you mean 'radius_m'?",
        "a.toml: items.0: expected a table, [[items]], got 3",
    ]


NOISE_RAD = math.radians(1.5)


@dataclass(frozen=True)
class Lens(Parameters, name="lens", error=SensorFileError):
    """A lens."""

    half_rad: Annotated[
        Number, Field(gt=0.0, le=math.pi), parameters.Typical(0.25 * math.pi, 0.5 * math.pi)
    ]
    """Half of the field of view."""
    turns_radps: tuple[Annotated[Number, Field(ge=0.0)], ...] = ()
    """Turn rates."""
    near_m: NotNegative = 0.1
    """Nearest surface."""
    far_m: Positive = 8.0
    """Farthest surface."""
    kind: Literal["auto"] | Annotated[Number, Field(le=1.0)] | None = None
    """Kind."""

    def _check(self):
        if not self.near_m < self.far_m:
            raise self._error("near_m", f"less than far_m = {self.far_m:g}")


@dataclass(frozen=True)
class Rig(Parameters, error=SensorFileError):
    """A rig."""

    lens: Lens
    others: tuple[Lens, ...] = ()
    probe: Probe = Probe()
    noise_rad_per_sqrt_m: NotNegative = NOISE_RAD
    """Noise."""
    drift_radpm: Number = 0.0
    """Drift."""
    matrix: np.ndarray = dataclasses.field(
        default_factory=lambda: np.eye(2), metadata=parameters.NOT_IN_FILES, compare=False
    )


def _read(table, kind=Rig):
    return parse_table(table, kind, SensorFileError, "a.toml")


def test_degrees_of_a_file_come_back_as_they_were():
    """Numbers of up to 15 digits, as people write them, to the last bit."""
    rng = np.random.default_rng(1)
    for digits in range(1, 16):
        for size in 10.0 ** rng.uniform(-9, 9, 40):
            angle_deg = float(f"{size * rng.choice((-1, 1)):.{digits}g}")
            assert in_degrees(math.radians(angle_deg)) == angle_deg
    assert [in_degrees(math.radians(one)) for one in (0.0, 90.0, 1e-4, 360.0)] == [0, 90, 1e-4, 360]
    for angle_rad in np.random.default_rng(2).uniform(-7.0, 7.0, 400).tolist():
        # some have no degrees that give them to the last bit
        assert math.radians(in_degrees(angle_rad)) == pytest.approx(angle_rad, rel=2.3e-16, abs=0)


def test_files_have_degrees_at_every_depth():
    table = {
        "lens": {"half_deg": 90, "turns_degps": [30.0, 45.0]},
        "others": [{"half_deg": 60.5, "near_m": 0.0}],
        "noise_deg_per_sqrt_m": 0.3,
        "drift_deg_per_m": -2.0,
    }
    rig = _read(table)
    assert (rig.lens.half_rad, rig.lens.turns_radps[1]) == (math.pi / 2, math.radians(45.0))
    assert rig.others == (Lens(math.radians(60.5), near_m=0.0),)
    assert (rig.noise_rad_per_sqrt_m, rig.drift_radpm) == (math.radians(0.3), math.radians(-2.0))
    assert rig.to_table() == table
    assert list(rig.matrix.ravel()) == [1.0, 0.0, 0.0, 1.0]
    assert _read({"lens": {"half_deg": 1.0}}).noise_rad_per_sqrt_m == math.radians(1.5)
    full = rig.to_table(full=True)
    assert full["lens"]["near_m"] == 0.1
    assert full["probe"]["mode"] == "auto"
    assert "kind" not in full["lens"]
    assert _read(full) == rig
    assert tomllib.loads(toml_text(full)) == full


def test_a_thing_is_a_field_in_python():
    rig = Rig(Lens(1.0), others=[Lens(2.0)])
    assert rig.others == (Lens(2.0),)
    with pytest.raises(SensorFileError, match=r"^lens: expected Lens, got 3$"):
        Rig(3)
    with pytest.raises(SensorFileError, match=r"^lens: expected Lens, got \{'half_deg': 3\}$"):
        Rig({"half_deg": 3})


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        ({"lens": {"half_deg": 181}}, "lens.half_deg: expected a number ≤ 180, got 181"),
        (
            {"lens": {"half_deg": 1, "half_rad": 1}},
            "lens.half_rad: unknown key; did you mean 'half_deg'?",
        ),
        (
            {"lens": {"half_deg": 1, "turns_degps": [-1]}},
            "lens.turns_degps.0: expected a number ≥ 0, got -1",
        ),
        ({"lens": {"half_deg": 1}, "others": 3}, "others: expected tables, [[others]], got 3"),
        ({"lens": {"half_deg": 1}, "others": [3]}, "others.0: expected a table, [[others]], got 3"),
        ({"lens": {"half_deg": 1, "far_m": 0.1}}, "lens.near_m: expected less than far_m = 0.1"),
        (
            {"lens": {"half_deg": 1}, "others": [{"half_deg": 2}, {"half_deg": 3, "near_m": 9}]},
            "others.1.near_m: expected less than far_m = 8, got 9",
        ),
        (
            {"lens": {"half_deg": 1}, "near_m": 1},
            "near_m: unknown key; expected in [lens] or [[oth",
        ),
        ({}, "lens: missing"),
    ],
)
def test_faults_of_things_name_file_key_and_value(table, fault):
    with pytest.raises(SensorFileError) as caught:
        _read(table)
    assert str(caught.value).startswith(f"a.toml: {fault}")
    assert "\n" not in str(caught.value)


def test_keys_are_those_of_the_class_with_help_limits_and_usual_range():
    half, turns, *_ = keys_of(table_of(Lens))
    assert (half.name, turns.name) == ("half_deg", "turns_degps")
    assert half.help == "Half of the field of view; typically 45 to 90."
    assert (half.low, half.high) == (Limit(0.0, True), Limit(180.0, False))
    assert (half.typical.low, half.typical.high) == (45.0, 90.0)
    noise = next(one for one in keys_of(table_of(Rig)) if one.name == "noise_deg_per_sqrt_m")
    assert noise.default == 1.5


def test_json_schema():
    schema = json_schema(table_of(Rig))
    lens = schema["$defs"]["Lens"]
    half = lens["properties"]["half_deg"]
    assert (half["exclusiveMinimum"], half["maximum"]) == (0.0, 180.0)
    assert half["description"] == "Half of the field of view; typically 45 to 90."
    assert (lens["required"], lens["additionalProperties"]) == (["half_deg"], False)
    assert schema["properties"]["noise_deg_per_sqrt_m"]["default"] == 1.5
    assert schema["properties"]["others"]["items"] == {"$ref": "#/$defs/Lens"}
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(schema)
    assert not list(validator.iter_errors({"lens": {"half_deg": 90}}))
    assert len(list(validator.iter_errors({"lens": {"half_deg": 200, "near": 1}}))) == 2


@overriding(Lens, "near_m", "half_deg")
class Changed(Table):
    """A device."""

    far_m: Number = 5.0
    """Its own."""


@overriding(Lens, "near_m", "far_m", defaults={"near_m": 0.5})
class Picked(Table):
    """Others."""


def test_a_table_has_fields_of_a_class():
    changed = parse_table({"half_deg": 3.0}, Changed, SensorFileError)
    assert dict(changed) == {"far_m": 5.0, "half_deg": 3.0, "near_m": None}
    assert dict(Picked()) == {"near_m": 0.5, "far_m": 8.0}
    texts = {key.name: key.help for key in keys_of(Changed)}
    assert (texts["far_m"], texts["near_m"]) == ("Its own.", "Nearest surface.")


@overriding(Lens, "near_m", "half_deg", defaults={}, order=("near_m", "own", "half_deg"))
class Ordered(Table):
    """A lens, and a key of its own."""

    last: Number = 1.0
    own: Number = 2.0


def test_fields_of_a_class_are_first_and_make_it_again():
    assert list(Ordered.model_fields) == ["near_m", "own", "half_deg", "last"]
    table = parse_table({"half_deg": 90.0}, Ordered, SensorFileError)
    assert table.build(Lens, far_m=3.0) == Lens(half_rad=math.radians(90.0), far_m=3.0)
    with pytest.raises(SensorFileError, match="known keys: near_m, own, half_deg, last"):
        parse_table({"half_deg": 90.0, "color": 3.0}, Ordered, SensorFileError)


def test_suggestions():
    known = ("range", "normals", "normals_camera")
    assert did_you_mean("rnage", known) == "did you mean 'range'?"
    assert did_you_mean("normal", known) == "did you mean 'normals' or 'normals_camera'?"
    assert did_you_mean("xyz", known) == "expected one of range, normals, normals_camera"
    assert did_you_mean("xyz", (), "it has") == "it has none"


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"a": 1, "b": 1e-9, "c": [1.0, 2], "d": True, "e": 'quo"te\\ \n\x7f é', "f": []},
        {"far_m": math.inf, "near_m": -math.inf},
        {"degradation": {"noise": {"seed": 1}}, "dotted.key": {"": 2}, "camera": {}},
        {"surfaces": [{"shape": "plane", "at_m": [0.0, 1.0]}, {"shape": "cone", "at": {}}]},
        {"points": [[{"x": 1}], [{"x": 2, "y": [3]}]]},
        tomllib.loads(DEFAULT_SENSOR_FILE.read_text(encoding="utf-8")),
    ],
)
def test_toml_is_read_back_as_the_same_table(table):
    assert tomllib.loads(toml_text(table)) == table


def test_none_leaves_a_key_out_and_comments_are_lines_of_their_own():
    assert toml_text({"a": None, "b": 1}) == "b = 1\n"
    text = toml_text({"#": Comment("one\nline"), "b": [{"c": Comment("beside"), "d": 2}]})
    assert text == "# one line\n\n[[b]]\n# beside\nd = 2\n"
