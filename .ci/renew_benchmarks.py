"""Keep the benchmarks' reports and figures, and put their tables on their pages.

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
    if "fps" in reports:
        report = reports["fps"]
        remarks = [f"- {remark}" for remark in report["remarks"]]
        _renew(
            "fps", [*_shown(kept, report, _fps_table(report)), "", *_bounds(report), "", *remarks]
        )
    if "peers" in reports:
        report = reports["peers"]
        _renew("peers", _shown(kept, report, _peers_table(report)))
        _renew("peers-goals", _bounds(report))
    machine = machine_line(read_report(kept / "peers.json")["machine"])
    _renew("times", [f"On {machine}:", "", *_times_table(kept)])


def _renew(mark: str, lines: Sequence[str]) -> None:
    renew_block(mark, "\n".join(lines) + "\n")


def _shown(kept: Path, report: dict[str, Any], table: Sequence[str]) -> list[str]:
    """Machine, figure and table of a suite."""
    figure = (kept / f"{report['suite']}.jpg").relative_to(ROOT)
    machine = machine_line(report["machine"])
    return [f"On {machine}:", "", f"![{report['suite']}]({figure})", "", *table]


def _times_table(kept: Path) -> list[str]:
    """Times that users wait, from the kept reports of all suites."""
    rows = {
        suite: read_report(kept / f"{suite}.json")["rows"]
        for suite in ("peers", "scaling", "drive", "live", "lenses")
    }

    def found(suite: str, key: str, **of: object) -> list[float]:
        return [row[key] for row in rows[suite] if of.items() <= row.items()]

    fast, default, sizes, towns, cameras = (
        found(suite, "p50_ms", **of)
        for suite, of in (
            ("peers", {"racer": "omnisim, fast"}),
            ("peers", {"racer": "omnisim, default"}),
            ("scaling", {"against": "image"}),
            ("scaling", {"against": "triangles"}),
            ("scaling", {"against": "cameras", "cameras": 8}),
        )
    )
    px = ", ".join(f"{size}²" for size in found("scaling", "image_px", against="image"))
    counts = found("scaling", "triangles", against="triangles")
    batch = {"against": "batch", "cameras": 64}
    (batched,), (single,) = (
        found("scaling", f"{key}images_per_second", **batch) for key in ("", "single_")
    )
    start, anew = found("drive", "seconds", kind="start-up")
    (rate,), (wait,) = (found("live", "value", what=what) for what in ("one view", "key to image"))
    return _table(
        ("", "median"),
        [
            ("a frame of 360 × 360 px, `fast`, in three scenes", _range(fast)),
            ("the same, `default`", _range(default)),
            (f"{px}, `fast`, a town of 31 000 triangles", _each(sizes)),
            (f"360², `fast`, towns of {', '.join(map(_count, counts))} triangles", _each(towns)),
            ("eight cameras of 360² on one stage, `fast`", _each(cameras)),
            (
                "images of 84² in batches of 64, `fast`",
                f"{batched:.0f} per second; one after the other {single:.0f}",
            ),
            ("`omnisim render`, from start to exit", f"{start:.1f} s"),
            ("the same, without cached shaders", f"{anew:.1f} s"),
            (
                "`omnisim live`, 360²",
                f"{rate:.0f} images per second; {wait:.0f} ms from key to image",
            ),
            (
                "the slowest camera model relative to the fastest, with equal virtual cameras",
                f"{max(found('lenses', 'ratio')):.2f} ×",
            ),
        ],
    )


def _range(times_ms: Sequence[float]) -> str:
    return f"{min(times_ms):.0f} to {max(times_ms):.0f} ms"


def _each(times_ms: Sequence[float]) -> str:
    return f"{', '.join(f'{one:.0f}' for one in times_ms)} ms"


def _count(triangles: float) -> str:
    return (
        f"{triangles / 1e6:.0f} million" if triangles > 9e5 else f"{triangles:_}".replace("_", " ")
    )


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
