"""Put the measures and figures of validation and experiments on their pages: make readme.

python .ci/renew_readme.py out/validation
python .ci/renew_readme.py out/experiments
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from pages import ROOT, renew_block, renew_figures

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
    if not report["passed"] or report["notices"]:
        sys.exit(f"{folder}: expected a whole report in which every bound holds")
    mark, figures, shown = SHOWN[report["title"]]
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
        *(
            f"| {title} | {measure['name']} | {_value(measure)} | {_bound(measure)} |"
            for section in report["sections"]
            for title, measure in _titled(
                section, [one for one in section["measures"] if one["bound"] is not None]
            )
        ),
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
