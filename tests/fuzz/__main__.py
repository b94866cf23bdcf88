"""Fuzzer of all readers: `python -m tests.fuzz --inputs 100000 --seed 1 --jobs 2`.

Each input is a sample that is damaged; only one of omnisim's errors may come of it, on one line.
Every finding is a folder under --output, with the file and the command that repeats it.
"""

import argparse
import itertools
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.fuzz.cases import Case, Finding, Samples
from tests.fuzz.readers import READERS
from tests.fuzz.workers import run_cases

KEPT = 3  # findings of a kind that are kept as files
PRINT_EVERY_S = 10.0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=10_000, help="how many, of all readers")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of each reader's first input")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--only", default="", help="readers whose names contain this")
    parser.add_argument("--output", type=Path, default=Path("out/fuzz"), help="for the findings")
    parser.add_argument("--repeat", metavar="READER:NUMBER", help="read one input again")
    return parser.parse_args()


def _repeat(case: Case, folder: Path, kept: Path) -> bool:
    samples = Samples(folder, tuple(READERS))
    name, data = samples.damaged(case)
    _keep(kept, case, name, data)
    print(f"{kept / str(case).replace(':', '-')}: {name}", flush=True)
    finding = samples.check(case)
    print("no finding" if finding is None else f"{finding.kind}\n{finding.detail}")
    return finding is None


def _keep(kept: Path, case: Case, name: str, data: bytes, detail: str = "") -> None:
    place = kept / str(case).replace(":", "-")
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    (place / Path(name).name).write_bytes(data)
    (place / "repeat.txt").write_text(f"{case.command}\n{name}\n{detail}\n", errors="replace")


def cases_of(names: tuple[str, ...], inputs: int, seed: int, first: int = 0):
    """Cases of all readers in turn."""
    numbered = ((name, number) for number in itertools.count(first) for name in names)
    for name, number in itertools.islice(numbered, inputs):
        yield Case(name, number, seed)


def _run(options: argparse.Namespace, folder: Path) -> bool:
    names = tuple(name for name in READERS if options.only in name)
    if not names:
        sys.exit(f"--only {options.only}: expected part of one of {', '.join(READERS)}")
    samples = Samples(folder / "samples", tuple(READERS))
    cases = cases_of(names, options.inputs, options.seed, options.first)
    done: Counter[str] = Counter()
    findings: dict[str, list[Finding]] = {}
    begun = printed = time.monotonic()
    for event in run_cases(samples, cases, options.jobs, folder):
        if isinstance(event, Finding):
            same = findings.setdefault(event.kind, [])
            same.append(event)
            if len(same) == 1:
                print(f"{event.case}: {event.kind}", flush=True)
            if len(same) <= KEPT:
                _keep(options.output, event.case, *samples.damaged(event.case), event.detail)
            continue
        done += event
        if time.monotonic() > printed + PRINT_EVERY_S:
            printed = time.monotonic()
            rate = done.total() / (printed - begun)
            count = sum(map(len, findings.values()))
            print(f"{done.total()} inputs, {rate:.0f} per second, {count} findings", flush=True)
    seconds = time.monotonic() - begun
    for name in names:
        print(f"{name:28}{done[name]:8}")
    for kind, same in sorted(findings.items()):
        print(f"{len(same)} × {kind}: {same[0].case.command}")
    count = sum(map(len, findings.values()))
    print(f"{done.total()} inputs in {seconds:.0f} s, seed {options.seed}: {count} findings")
    return not findings


def main() -> None:
    """Run, or repeat one input; exit status 1 with findings."""
    options = _arguments()
    with tempfile.TemporaryDirectory(prefix="omnisim-fuzz-") as folder:
        if options.repeat:
            reader, _, number = options.repeat.rpartition(":")
            case = Case(reader, int(number), options.seed)
            passed = _repeat(case, Path(folder), options.output)
        else:
            passed = _run(options, Path(folder))
    sys.exit(0 if passed else 1)


if __name__ == "__main__":
    main()
