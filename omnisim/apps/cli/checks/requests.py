"""Requests of `omnisim doctor`, `schema`, `validate` and `experiments`."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal

from omnisim.apps.cli.option_groups import DeviceOptions
from omnisim.apps.cli.options import Argument, Option, command


def _check_names() -> Iterable[str]:
    from omnisim.validation.check_registry import CHECKS  # seldom needed

    return (check.key for check in CHECKS)


@command("doctor", "checks.doctor.run")
class DoctorRequest(DeviceOptions):
    """Diagnose OpenGL on this machine step by step, and say what to do; exits with 1 if a step
    fails.

    omnisim doctor
    omnisim doctor --report doctor.json
    """

    report: Path | None = None
    """JSON file for all results, without the names of the user, the machine and their folders."""


@command("schema", "checks.schema.run")
class SchemaRequest:
    """Print the JSON Schema of a TOML file, for editors.

    omnisim schema robot
    omnisim schema scene > scene.schema.json
    """

    file: Annotated[
        Literal["robot", "sensor", "scene", "plan", "optics", "sweep", "measure"], Argument()
    ]
    """Kind of file."""


@command("validate", "checks.validate.run", extra="reports")
class ValidateRequest(DeviceOptions):
    """Validate the geometry against the paper's figures and independent oracles; exits with 1 if a
    tolerance is exceeded.

    omnisim validate --quick -o report
    omnisim validate --only rings -o report
    """

    output: Annotated[Path, Option(metavar="DIR")]
    """Folder for report.html, report.json and figures."""
    quick: bool = False
    """Skip the path tracer, the slowest check."""
    only: Annotated[list[str] | None, Option(metavar="CHECK", names=_check_names)] = None
    """Run only this check; can be repeated: {names}."""


@command("experiments", "checks.validate.experiments", extra="reports")
class ExperimentsRequest(DeviceOptions):
    """Repeat the paper's self-localization experiments; exits with 1 if a tolerance is exceeded.

    omnisim experiments -o report
    omnisim experiments --device 1 -o report
    """

    output: Annotated[Path, Option(metavar="DIR")]
    """Folder for the drives, report.html, report.json and figures."""


@command("info", "info.run")
class InfoRequest:
    """Show versions, built-in scenes, and the GPUs that can render.

    omnisim info
    """
