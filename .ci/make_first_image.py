"""Render the image of the documentation's first page: `python .ci/make_first_image.py FILE`.

The command of that page, and what it writes: image, range, normals and instances, side by side.
"""

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

PAGE = Path(__file__).resolve().parents[1] / "docs" / "index.md"
GAP_PX = 12


def main(file: Path) -> None:
    """Run the page's command in an empty folder and write its images as one."""
    command = re.search(r"^omnisim (render .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    if command is None:
        raise SystemExit(f"{PAGE}: expected a line that begins with omnisim render")
    with tempfile.TemporaryDirectory() as folder:
        arguments = [sys.executable, "-m", "omnisim", *shlex.split(command[1])]
        subprocess.run(arguments, cwd=folder, check=True)
        names = ("frame", "frame.range.preview", "frame.normals.preview", "frame.instance.preview")
        tiles = [Image.open(Path(folder, f"{name}.png")).convert("RGBA") for name in names]
    width, height = tiles[0].size
    circle = Image.new("L", (width, height))  # of the mirror's rim, which touches the edges
    ImageDraw.Draw(circle).ellipse((0, 0, width - 1, height - 1), fill=255)
    row = Image.new("RGBA", (len(tiles) * (width + GAP_PX) - GAP_PX, height))
    for number, tile in enumerate(tiles):
        row.paste(tile, (number * (width + GAP_PX), 0), circle)
    row.save(file, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
