"""Put the proof's numbers and figures into README: make readme."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
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
WIDEST_PX = 1100


def main() -> None:
    """Read the report in the folder that is named and renew what README shows of it."""
    folder = Path(sys.argv[1])
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    if not report["passed"] or report["quick"] or report["skipped"] or report["left_out"]:
        sys.exit(f"{folder}: want a whole report in which every bound holds")
    FIGURES.mkdir(exist_ok=True)
    for name in SHOWN:
        picture = Image.open(folder / f"{name}.png").convert("RGB")
        picture.thumbnail((WIDEST_PX, 10 * WIDEST_PX), Image.Resampling.LANCZOS)
        picture.save(FIGURES / f"{name}.jpg", quality=88, optimize=True)
    readme = ROOT / "README.md"
    text, count = re.subn(
        r"(<!-- proof -->\n).*?(<!-- end of proof -->)",
        lambda match: match[1] + _table(report) + match[2],
        readme.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    if count != 1:
        sys.exit("README.md: want one place for the proof, between its two comments")
    readme.write_text(text, encoding="utf-8")


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
