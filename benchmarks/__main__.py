"""Run a suite: `python -m benchmarks lenses -o results.json`."""

from __future__ import annotations

import argparse
import json
import sys
from importlib import import_module
from pathlib import Path

from benchmarks.timer import ROUNDS

SUITES = ("lenses",)


def main() -> None:
    """Run the suite that is named, print what it found; status 1 where its bound does not hold."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("suite", choices=SUITES)
    parser.add_argument("-o", "--output", type=Path, help="also write the whole report as JSON")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"timed rounds ({ROUNDS})")
    arguments = parser.parse_args()
    suite = import_module(f"benchmarks.suites.{arguments.suite}")
    report = suite.run(arguments.rounds)
    print("\n".join(suite.lines(report)))
    if arguments.output is not None:
        text = json.dumps(report, indent=2) + "\n"
        arguments.output.write_text(text, encoding="utf-8")
    sys.exit(not report["passed"])


if __name__ == "__main__":
    main()
