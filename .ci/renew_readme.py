"""Put the measures and figures of validation and experiments on their pages: make readme.

python .ci/renew_readme.py out/validation
python .ci/renew_readme.py out/experiments

Of a report of some checks, as by `omnisim validate --only response -o out/part`, it renews their
rows, and keeps those of the others:

python .ci/renew_readme.py out/part
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from pages import ROOT, block_of, renew_block, renew_figures

from omnisim.validation.check_registry import CHECKS

# By title of the report: mark, folder of the figures, figures that the pages show.
SHOWN = {
    "Validation": (
        "validation",
        ROOT / "omnisim" / "validation" / "figures",
        (
            "fig7-rings",
            "fig7-radii",
            "fig8-polygons",
            "fig9-detail",
            "convergence",
            "traced-mirror",
            "traced-optics",
            "orientation-panorama",
            "unwarped",
        ),
    ),
    "Self-localization": (
        "experiments",
        ROOT / "omnisim" / "experiments" / "figures",
        ("fig11-images", "fig12-paths", "fig13-errors", "seeds", "seeds-ahead", "degradations"),
    ),
}


def main() -> None:
    """Read the report in the folder that is named and renew its block and figures."""
    folder = Path(sys.argv[1])
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    is_part = bool(report["facts"].get("left_out")) and not report["facts"].get("quick")
    if not report["passed"] or (report["notices"] and not is_part):
        sys.exit(f"{folder}: expected a whole report in which every bound holds")
    mark, figures, shown = SHOWN[report["title"]]
    if is_part:
        renew_figures(
            folder, figures, [name for name in shown if (folder / f"{name}.png").exists()]
        )
        renew_block(mark, "\n".join(_merged_table(report, block_of(mark))) + "\n")
        return
    renew_figures(folder, figures, shown)
    table = _validation_table if report["title"] == "Validation" else _experiments_table
    renew_block(mark, "\n".join(table(report)) + "\n")


def _validation_table(report: dict[str, Any]) -> list[str]:
    machine, seconds = report["machine"], report["facts"]["seconds"]
    return [
        f"On {machine['renderer']}, {machine['cores']} cores, in {seconds:.0f} s:",
        "",
        "| check | measured | value | bound |",
        "| --- | --- | --- | --- |",
        *(row for section in report["sections"] for row in _rows(section)),
    ]


def _merged_table(report: dict[str, Any], block: str) -> list[str]:
    """Lines of a block in which the rows of the report's checks replace those of the same title."""
    lines = block.splitlines()
    first = next(index for index, line in enumerate(lines) if line.startswith("| ---")) + 1
    rows: dict[str, list[str]] = {}
    title = ""
    for line in lines[first:]:
        title = line.split("|")[1].strip() or title
        rows.setdefault(title, []).append(line)
    rows |= {section["title"]: _rows(section) for section in report["sections"]}
    return [*lines[:first], *(row for check in CHECKS for row in rows.get(check.title, []))]


def _rows(section: dict[str, Any]) -> list[str]:
    """Rows of a check's measures with a bound."""
    measures = [one for one in section["measures"] if one["bound"] is not None]
    return [
        f"| {title} | {measure['name']} | {_value(measure)} | {_bound(measure)} |"
        for title, measure in _titled(section, measures)
    ]


def _experiments_table(report: dict[str, Any]) -> list[str]:
    return [
        "| | measured | value | bound | the paper |",
        "| --- | --- | --- | --- | --- |",
        *(
            f"| {title} | {measure['name']} | {_value(measure)} | {_bound(measure)} "
            f"| {measure['paper']} |"
            for section in report["sections"]
            for title, measure in _titled(section, section["measures"])
        ),
    ]


def _titled(
    section: dict[str, Any], measures: list[dict[str, Any]]
) -> list[tuple[str, dict[str, Any]]]:
    """Measures, the first with the title of its section."""
    return [("" if index else section["title"], one) for index, one in enumerate(measures)]


def _value(measure: dict[str, Any]) -> str:
    return "not a number" if measure["value"] is None else _number(measure, "value")


def _bound(measure: dict[str, Any]) -> str:
    if measure["bound"] is None:
        return ""
    return f"{'≥' if measure['sense'] == 'at least' else '≤'} {_number(measure, 'bound')}"


def _number(measure: dict[str, Any], key: str) -> str:
    return f"{measure[key]:.3g} {measure['unit']}".rstrip()


if __name__ == "__main__":
    main()
