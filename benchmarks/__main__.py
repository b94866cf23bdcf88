"""Run a suite, or all: `python -m benchmarks fps -o out/benchmarks`."""

from __future__ import annotations

import argparse
import difflib
import sys
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.progress import show_progress
from benchmarks.timer import ROUNDS, WARM_UP
from omnisim.apps.cli.console import err
from omnisim.core.errors import OmnisimError, OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_target
from omnisim.rendering.opengl.gl.diagnosis import device_number
from omnisim.report.machine import machine_line

# In the order of `all`; each is a module, imported when it runs.
SUITES = ("fps", "scaling", "limit", "peers", "drive", "lenses", "live", "serve")
ALL = "all"
DEFAULT_FOLDER = Path("out") / "benchmarks"


class _Parser(argparse.ArgumentParser):
    """Parser that reports errors in one line."""

    def error(self, message: str) -> NoReturn:
        """Print the error, and exit with status 2."""
        print(f"error: {message}", file=sys.stderr)
        sys.exit(2)


def main(arguments: list[str] | None = None) -> int:
    """Run suites, print and write their reports.

    Returns:
        Exit status: 1 if a bound does not hold or a suite cannot run; 2 for invalid arguments.
        Goals do not count.
    """
    parsed = _parser().parse_args(arguments)
    try:
        require_extra("plots", "python -m benchmarks")
        names = _suite_names(parsed.suite)
        options = Options(
            rounds=parsed.rounds,
            warm_up=parsed.warm_up,
            device=parsed.device,
            scenes=tuple(parsed.scene),
            is_full=parsed.full or parsed.suite == ALL,
            progress=partial(show_progress, err=err.console),
        )
        _make_folder(parsed.output, names)
    except OmnisimError as reason:
        print(f"error: {reason}", file=sys.stderr)
        return 2
    # all suites run before the status reports a failure
    reports = [_report(name, options, parsed.output) for name in names]
    from benchmarks.report import verdict  # needs the extra

    print(verdict([report for report in reports if report is not None]))
    return 0 if all(report is not None and report["passed"] for report in reports) else 1


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("suite", help=f"{', '.join(SUITES)}, or {ALL}")
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, default=DEFAULT_FOLDER,
        help=f"folder for <suite>.json and <suite>.png ({DEFAULT_FOLDER})",
    )  # fmt: skip
    parser.add_argument(
        "--full", action="store_true",
        help=f"fps: all lights and sizes, without a limit of time; {ALL} does so, too",
    )  # fmt: skip
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"timed rounds ({ROUNDS})")
    parser.add_argument(
        "--warm-up", type=int, default=WARM_UP, help=f"rounds before, not timed ({WARM_UP})"
    )
    parser.add_argument(
        "--device", metavar="N|cuda:N", type=_device, help="number of the GPU, see `omnisim info`"
    )
    parser.add_argument(
        "--scene", nargs="+", action="extend", default=[], metavar="S",
        help="built-in names or files, instead of the suite's own choice",
    )  # fmt: skip
    return parser


def _device(text: str) -> int:
    try:
        return device_number(text)
    except OmnisimError as reason:
        raise argparse.ArgumentTypeError(str(reason)) from None


def _suite_names(suite: str) -> list[str]:
    """Names of the suites to run.

    Raises:
        BenchmarkError: no suite has that name.
    """
    available = [name for name in SUITES if find_spec(f"benchmarks.suites.{name}")]
    if suite == ALL:
        return available
    if suite not in available:
        near = difflib.get_close_matches(suite, available, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"expected {', '.join(available)} or {ALL}"
        raise BenchmarkError(f"suite {suite!r}: no such suite; {hint}")
    return [suite]


def _make_folder(folder: Path, names: list[str]) -> None:
    """Create the output folder, or refuse it before the work is done.

    Raises:
        OutputError: the folder cannot be created or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{folder}: cannot be created: {reason.strerror}") from None
    for name in names:
        for suffix in (".json", ".png"):
            check_target(folder / f"{name}{suffix}")


def _report(name: str, options: Options, folder: Path) -> dict[str, Any] | None:
    """Run a suite, and print and write its report; None: the suite cannot run.

    A suite with a bound that fails runs once more, and the second run counts: other programs may
    have slowed one of the two sides that a bound compares, but rarely the same one twice.
    """
    from benchmarks.report import failures, write_report  # needs the extra

    try:
        suite = import_module(f"benchmarks.suites.{name}")
        report: dict[str, Any] = suite.run(options)
        if not report["passed"]:
            print(f"{name}: measured again, since {'; '.join(failures(report))}", flush=True)
            report = suite.run(options)
        print(f"{name}, on {machine_line(report['machine'])}")
        print("\n".join(suite.lines(report)))
        write_report(folder, report, suite.figure(report))
        print(f"figure: {folder / name}.png", end="\n\n", flush=True)
    except OmnisimError as reason:
        print(f"error: {name}: {reason}", file=sys.stderr)
        return None
    return report


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
