"""Draw the figure of the documentation's first page: `python .ci/make_first_image.py FILE`.

It runs the command of that page and shows the images that the command writes, with their names.
"""

import base64
import io
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parents[1] / "docs"
sys.path.append(str(DOCS / "_ext"))
from figure_style import WIDTH, svg, text  # noqa: E402

PAGE = DOCS / "index.md"
SIDE_PX, GAP_PX = 168, 16
COLUMNS = (
    ("frame.png", "what the camera sees"),
    ("frame.range.png", "length of each ray, in meters"),
    ("frame.normals.png", "direction of each surface"),
    ("frame.instance.png", "a number for each object"),
)


def main(file: Path) -> None:
    """Run the page's command in an empty folder and draw its images side by side."""
    command = re.search(r"^omnisim (render .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    if command is None:
        raise SystemExit(f"{PAGE}: expected a line that begins with omnisim render")
    with tempfile.TemporaryDirectory() as folder:
        arguments = [sys.executable, "-m", "omnisim", *shlex.split(command[1])]
        subprocess.run(arguments, cwd=folder, check=True)
        parts = [_column(number, Path(folder)) for number in range(len(COLUMNS))]
    file.write_text(svg("Images of one command", SIDE_PX + 78, parts), encoding="utf-8")


def _column(number: int, folder: Path) -> str:
    """Image in the circle of the mirror's rim, with its file and meaning below."""
    name, meaning = COLUMNS[number]
    preview = folder / name.replace(".png", ".preview.png")
    image = Image.open(preview if preview.exists() else folder / name).convert("RGB")
    left = (WIDTH - len(COLUMNS) * (SIDE_PX + GAP_PX) + GAP_PX) / 2 + number * (SIDE_PX + GAP_PX)
    middle = left + SIDE_PX / 2
    return "\n".join(
        (
            f'<image x="{left}" y="16" width="{SIDE_PX}" height="{SIDE_PX}" '
            f'style="clip-path: circle(50%)" href="{_data(image)}"/>',
            text(middle, SIDE_PX + 42, name, "code", "middle"),
            text(middle, SIDE_PX + 61, meaning, "muted", "middle"),
        )
    )


def _data(image: Image.Image) -> str:
    stream = io.BytesIO()
    image.save(stream, "JPEG", quality=88)
    return f"data:image/jpeg;base64,{base64.b64encode(stream.getvalue()).decode()}"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
