"""Keep the benchmarks' reports and figures, and put Fig. 10 and the race on their pages.

python .ci/renew_benchmarks.py out/benchmarks [--results-only]

They go to benchmarks/results/<machine>/; with --results-only the pages stay: they show one
machine.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from pages import ROOT, renew_block, renew_figures

sys.path.insert(0, str(ROOT))

from benchmarks.__main__ import SUITES
from benchmarks.bounds import entry_cells
from benchmarks.report import read_report
from benchmarks.suites.fps import fps_table
from omnisim.core.errors import OmnisimError
from omnisim.report.machine import machine_line

RESULTS = ROOT / "benchmarks" / "results"
USAGE = "usage: python .ci/renew_benchmarks.py DIR [--results-only]"


def main() -> None:
    """Read the reports of a folder, and renew their copies and the pages."""
    arguments = sys.argv[1:]
    is_results_only = "--results-only" in arguments
    names = [argument for argument in arguments if argument != "--results-only"]
    if len(names) != 1:
        sys.exit(USAGE)
    folder = Path(names[0])
    try:
        reports = {
            suite: read_report(folder / f"{suite}.json")
            for suite in SUITES
            if (folder / f"{suite}.json").is_file()
        }
    except OmnisimError as reason:
        sys.exit(f"error: {reason}")
    if not reports:
        sys.exit(f"{folder}: has no reports: run `make bench` first")
    machines = {report["machine"]["name"] for report in reports.values()}
    commits = {report["machine"]["commit"] for report in reports.values()}
    if len(machines) != 1 or len(commits) != 1:
        sys.exit(f"{folder}: expected reports of one machine and one commit: run all suites again")
    kept = RESULTS / machines.pop()
    kept.mkdir(parents=True, exist_ok=True)
    for suite in reports:
        shutil.copyfile(folder / f"{suite}.json", kept / f"{suite}.json")
    renew_figures(folder, kept, reports)
    if is_results_only:
        return
    for suite, table in (("fps", _fps_table), ("peers", _peers_table)):
        if suite in reports:
            report = reports[suite]
            figure = (kept / f"{suite}.jpg").relative_to(ROOT)
            lines = [
                f"On {machine_line(report['machine'])}:", "", f"![{suite}]({figure})", "",
                *table(report), "", *_bounds(report), "",
                *(f"- {remark}" for remark in report.get("remarks", ())),
            ]  # fmt: skip
            renew_block(suite, "\n".join(lines) + "\n")


def _fps_table(report: dict[str, Any]) -> list[str]:
    """Fig. 10 at the paper's size."""
    size_px = min(row["size_px"] for row in report["rows"])
    (_, *groups), *rows = fps_table([r for r in report["rows"] if r["size_px"] == size_px])
    return _table((f"frames per second, {size_px}²", *groups), rows)


def _peers_table(report: dict[str, Any]) -> list[str]:
    """A row for each racer, a column for each scene: time, quality, and the ratio to ours."""
    rows = [row for row in report["rows"] if row["missing"] is None]
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    cells = {(row["racer"], row["scene"]): _raced(row) for row in rows}
    return _table(
        (f"the same frame, {report['image_px']}²", *scenes),
        [
            (racer, *(cells.get((racer, scene), "") for scene in scenes))
            for racer in dict.fromkeys(row["racer"] for row in rows)
        ],
    )


def _raced(row: dict[str, Any]) -> str:
    cell = f"{row['p50_ms']:.1f} ms"
    if row["psnr_db"] is not None:
        cell += f", {row['psnr_db']:.1f} dB"
    if row["racer"].startswith("omnisim"):
        return cell
    return f"{cell}: {row['ratio']:.3g} × ours at {row['ratio_to'].removeprefix('omnisim, ')}"


def _bounds(report: dict[str, Any]) -> list[str]:
    """Judged numbers beside their bounds and goals."""
    return _table(("", "measured", "bound", "goal"), map(entry_cells, report["bounds"]))


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Table in Markdown."""
    cells = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(row)} |" for row in cells]


if __name__ == "__main__":
    main()
