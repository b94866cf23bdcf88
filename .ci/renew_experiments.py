"""Put the experiments' numbers and figures into README, between its two comments.

python .ci/renew_experiments.py out/experiments
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from readme import ROOT, renew_figures, renew_table

FIGURES = ROOT / "omnisim" / "experiments" / "figures"
SHOWN = ("fig11-pictures", "fig12-paths", "fig13-errors", "seeds", "seeds-ahead", "degradations")


def main() -> None:
    """Read the report in the folder that is named and renew what README shows of it."""
    folder = Path(sys.argv[1])
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    missed = [
        number["name"]
        for section in report["sections"]
        for number in section["numbers"]
        if number["passed"] is False
    ]
    if missed:
        sys.exit(f"{folder}: want a report in which every bound holds, not {'; '.join(missed)}")
    renew_figures(folder, FIGURES, SHOWN)
    renew_table("experiments", _table(report))


def _table(report: dict) -> str:
    lines = ["| | measured | value | bound | the paper |", "| --- | --- | --- | --- | --- |"]
    for section in report["sections"]:
        for index, number in enumerate(section["numbers"]):
            value, unit = number["value"], f" {number['unit']}" if number["unit"] else ""
            told = "not a number" if value is None else f"{value:.3g}{unit}"
            bound = ""
            if number["bound"] is not None:
                sign = "≥" if number["sense"] == "at least" else "≤"
                bound = f"{sign} {number['bound']:.3g}{unit}"
            title = "" if index else section["title"]
            lines.append(f"| {title} | {number['name']} | {told} | {bound} | {number['paper']} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
