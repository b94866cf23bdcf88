"""Put the proof's numbers and figures into README: make readme."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from readme import ROOT, renew_figures, renew_table

FIGURES = ROOT / "omnisim" / "validation" / "figures"
SHOWN = (
    "fig7-rings",
    "fig7-radii",
    "fig8-polygons",
    "fig9-detail",
    "convergence",
    "traced-mirror",
    "orientation-panorama",
    "unwarped",
)


def main() -> None:
    """Read the report in the folder that is named and renew what README shows of it."""
    folder = Path(sys.argv[1])
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    if not report["passed"] or report["quick"] or report["skipped"] or report["left_out"]:
        sys.exit(f"{folder}: want a whole report in which every bound holds")
    renew_figures(folder, FIGURES, SHOWN)
    renew_table("proof", _table(report))


def _table(report: dict) -> str:
    machine = report["machine"]
    lines = [
        f"On {machine['renderer']}, {machine['cores']} cores, in {report['seconds']:.0f} s:",
        "",
        "| check | measured | value | bound |",
        "| --- | --- | --- | --- |",
    ]
    for check in report["checks"]:
        for index, measure in enumerate(check["measures"]):
            sign = "≥" if measure["sense"] == "at least" else "≤"
            unit = f" {measure['unit']}" if measure["unit"] else ""
            title = check["title"] if index == 0 else ""
            lines.append(
                f"| {title} | {measure['name']} | {measure['value']:.3g}{unit} "
                f"| {sign} {measure['bound']:.3g}{unit} |"
            )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
