"""Draw the documentation's figures that show images: `python .ci/make_image_figures.py`.

The first page's figure shows what its command writes; another, the steps of rendering.
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
from figure_style import WIDTH, path, svg, text  # noqa: E402

PAGE = DOCS / "index.md"
SIDE_PX, GAP_PX = 168, 16
COLUMNS = (
    ("frame.png", "what the camera sees"),
    ("frame.range.png", "length of each ray, in meters"),
    ("frame.normals.png", "direction of each surface"),
    ("frame.instance.png", "a number for each object"),
)
FACE_PX = 74
FACES = {"left": (0, 0), "front": (1, 0), "right": (2, 0), "back": (3, 0), "down": (1, 1)}


def first_figure() -> str:
    """Images that the first page's command writes, with their names and meanings."""
    command = re.search(r"^omnisim (render .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    if command is None:
        raise SystemExit(f"{PAGE}: expected a line that begins with omnisim render")
    left = (WIDTH - len(COLUMNS) * (SIDE_PX + GAP_PX) + GAP_PX) / 2
    parts = []
    with tempfile.TemporaryDirectory() as folder:
        _omnisim(Path(folder), command[1])
        for number, (name, meaning) in enumerate(COLUMNS):
            x = left + number * (SIDE_PX + GAP_PX)
            parts += [
                _disc(x, 16, SIDE_PX, Path(folder, name)),
                text(x + SIDE_PX / 2, SIDE_PX + 42, name, "code", "middle"),
                text(x + SIDE_PX / 2, SIDE_PX + 61, meaning, "muted", "middle"),
            ]
    return svg("Images of one command", SIDE_PX + 78, parts)


def steps_figure() -> str:
    """Virtual cameras, the image that samples them, degradations and ground truth."""
    parts = [
        text(10, 28, "1  virtual cameras", "name"),
        text(372, 28, "2, 3  remapping, averaging", "name"),
        text(600, 28, "4  degradations", "name"),
        text(182, 272, "5  ground truth", "name"),
        text(182, 310, "rays meet the triangles seen", "muted"),
        path("M322 128H362"),
        path("M550 128H590"),
        path("M123 206V288H384"),
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _omnisim(folder, "render courtyard --size 320 --faces . --also instance --preview -o a.png")
        _omnisim(folder, "render courtyard --size 320 --preset bad-day --turn-rate 40 -o b.png")
        for face, (column, row) in FACES.items():
            x, y = 10 + (FACE_PX + 2) * column, 44 + (FACE_PX + 2) * row
            parts.append(_image(x, y, FACE_PX, folder / f"{face}.png"))
        parts += [
            _disc(372, 44, 168, folder / "a.png"),
            _disc(600, 66, 124, folder / "b.png"),
            _disc(394, 226, 124, folder / "a.instance.png"),
        ]
    return svg("Steps of rendering", 366, parts)


def _omnisim(folder: Path, command: str) -> None:
    arguments = [sys.executable, "-m", "omnisim", *shlex.split(command)]
    subprocess.run(arguments, cwd=folder, check=True)


def _disc(x: float, y: float, side: float, file: Path) -> str:
    """Image in the circle of the mirror's rim."""
    return _image(x, y, side, file, ' style="clip-path: circle(50%)"')


def _image(x: float, y: float, side: float, file: Path, style: str = "") -> str:
    """Image, or its preview, at twice the size at which it is shown."""
    preview = file.with_suffix(".preview.png")
    image = Image.open(preview if preview.exists() else file).convert("RGB")
    image.thumbnail((2 * side, 2 * side))
    stream = io.BytesIO()
    image.save(stream, "JPEG", quality=88)
    data = base64.b64encode(stream.getvalue()).decode()
    return (
        f'<image x="{x}" y="{y}" width="{side}" height="{side}"{style} '
        f'href="data:image/jpeg;base64,{data}"/>'
    )


if __name__ == "__main__":
    for file, figure in (
        (DOCS / "first.svg", first_figure()),
        (DOCS / "explanation" / "figures" / "steps.svg", steps_figure()),
    ):
        file.write_text(figure, encoding="utf-8")
