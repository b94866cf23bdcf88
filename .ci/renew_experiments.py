"""Put the experiments' numbers and figures into README, between its two comments.

python .ci/renew_experiments.py out/experiments
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / "omnisim" / "experiments" / "figures"
SHOWN = ("fig11-pictures", "fig12-paths", "fig13-errors", "seeds", "seeds-ahead", "degradations")
WIDEST_PX = 1100


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
    FIGURES.mkdir(exist_ok=True)
    for name in SHOWN:
        picture = Image.open(folder / f"{name}.png").convert("RGB")
        picture.thumbnail((WIDEST_PX, 10 * WIDEST_PX), Image.Resampling.LANCZOS)
        picture.save(FIGURES / f"{name}.jpg", quality=88, optimize=True)
    readme = ROOT / "README.md"
    text, count = re.subn(
        r"(<!-- experiments -->\n).*?(<!-- end of experiments -->)",
        lambda match: match[1] + _table(report) + match[2],
        readme.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    if count == 1:
        readme.write_text(text, encoding="utf-8")
    else:  # nobody has made room for it yet
        print(_table(report))


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
