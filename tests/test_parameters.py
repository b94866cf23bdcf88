"""Parameters and tables: values that fit, and one line for each fault."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pytest

from omnisim.core.errors import OpticsError, SensorFileError, did_you_mean
from omnisim.core.files.parameters import (
    Fraction,
    NotNegative,
    Number,
    Parameters,
    Positive,
    Table,
    described,
    parse_table,
    table_of,
)


@dataclass(frozen=True)
class Probe(Parameters, name="probe"):
    size_px: Positive = 1.0
    share: Fraction | None = None
    offset_px: tuple[Number, Number] = (0.0, 0.0)
    mode: Annotated[Literal["auto"] | NotNegative, described("a number ≥ 0 or 'auto'")] = "auto"

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
        ({"size_px": "1"}, "size_px: expected a number, got '1'"),
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


def test_each_fault_is_one_line():
    with pytest.raises(OpticsError) as caught:
        Probe(size_px=-1.0, mode="off")
    assert len(str(caught.value).splitlines()) == 2


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


def test_suggestions():
    known = ("range", "normals", "normals_camera")
    assert did_you_mean("rnage", known) == "did you mean 'range'?"
    assert did_you_mean("normal", known) == "did you mean 'normals' or 'normals_camera'?"
    assert did_you_mean("xyz", known) == "expected one of range, normals, normals_camera"
    assert did_you_mean("xyz", (), "it has") == "it has none"
