"""`omnisim experiments`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from rich.console import Console

from omnisim.cli.progress import count_along
from omnisim.experiments.page import check_folder
from omnisim.experiments.paper import run_experiments


def run(output: Path, device: int | None, out: Console, err: Console) -> bool:
    """Run the experiments, write their page, and return whether every bound holds.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    check_folder(output)
    start = time.monotonic()
    page = run_experiments(output, device, _progress(err))
    for section in page.sections:
        if section.numbers:
            out.print(section.title, style="bold", markup=False)
        for number in section.numbers:
            value = f"{number.value:.4g}" if math.isfinite(number.value) else "not a number"
            unit = f" {number.unit}" if number.unit else ""
            told = f"  {number.name}: {value}{unit}"
            if number.bound is not None:
                told += f" {'≥' if number.at_least else '≤'} {number.bound:.4g}"
            told += f" (the paper: {number.paper})" if number.paper else ""
            out.print(told, style="red" if number.passed is False else None, markup=False)
    missed = f"; {len(page.missed)} bounds missed" if page.missed else "; every bound holds"
    seconds = time.monotonic() - start
    out.print(f"{output / 'report.html'}: {seconds:.0f} s{missed}", markup=False)
    return not page.missed


def _progress(err: Console) -> Callable[[str, int], Callable[[Iterable[int]], Iterable[int]]]:
    """Progress bars on a terminal, a line for each part elsewhere."""

    def part(what: str, total: int) -> Callable[[Iterable[int]], Iterable[int]]:
        def along(steps: Iterable[int]) -> Iterator[int]:
            if not err.is_terminal:
                err.print(what, markup=False)
            yield from count_along(steps, what, total, err)

        return along

    return part
