"""Requests of `omnisim doctor`, `schema`, `validate` and `experiments`."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from omnisim.apps.cli import completion
from omnisim.apps.cli.option_groups import DeviceOptions
from omnisim.apps.cli.options import Argument, Option


@dataclass(frozen=True, kw_only=True)
class DoctorRequest(DeviceOptions):
    """Parameters of `omnisim doctor`."""

    report: Path | None = None
    """JSON file for all results, without names of the user, the machine and their folders."""


class SchemaFile(StrEnum):
    """Kind of a TOML file."""

    ROBOT = "robot"
    SENSOR = "sensor"
    SCENE = "scene"
    PLAN = "plan"
    OPTICS = "optics"
    SWEEP = "sweep"
    MEASURE = "measure"


@dataclass(frozen=True, kw_only=True)
class SchemaRequest:
    """Parameters of `omnisim schema`."""

    file: Annotated[SchemaFile, Argument()]
    """Kind of file."""


@dataclass(frozen=True, kw_only=True)
class ValidateRequest(DeviceOptions):
    """Parameters of `omnisim validate`."""

    output: Annotated[Path, Option(metavar="DIR")]
    """Folder for report.html, report.json and figures."""
    quick: bool = False
    """Skip the path tracer, the slowest check."""
    only: Annotated[list[str] | None, Option(metavar="CHECK", names=completion.check_names)] = None
    """Run only this check; can be repeated."""


@dataclass(frozen=True, kw_only=True)
class ExperimentsRequest(DeviceOptions):
    """Parameters of `omnisim experiments`."""

    output: Annotated[Path, Option(metavar="DIR")]
    """Folder for the drives, report.html, report.json and figures."""
