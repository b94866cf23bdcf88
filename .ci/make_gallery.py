"""Gallery of one scene through every camera model: make gallery.

The page takes its text from the docstrings of the models' modules; the camera of an image is the
first example of its model in `tests/camera_examples.py`.
"""

from __future__ import annotations

import inspect
import json
import math
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / ".ci")]

from pages import save_jpeg  # noqa: E402

from omnisim import OmniCamera, open_sensor  # noqa: E402
from omnisim.apps.live.camera_document import PRESETS_FILE  # noqa: E402
from omnisim.cameras import CAMERA_MODELS, CentralCamera  # noqa: E402
from omnisim.cameras.models.field_of_view import FieldOfView, field_of_view  # noqa: E402
from omnisim.core.files.file_keys import keys_of  # noqa: E402
from omnisim.core.files.parameters import table_of  # noqa: E402
from omnisim.scene import load_scene  # noqa: E402
from tests.camera_examples import CAMERA_EXAMPLES  # noqa: E402

FOLDER = ROOT / "omnisim" / "cameras" / "gallery"
SCENE = "courtyard"
VIEWPOINT_M = (0.6, -0.5, 1.2)  # off the middle: an image that is turned or mirrored shows it
YAW_DEG = 40.0
LONGER_SIDE_PX = 400
SUPERSAMPLING = 4
MAX_BYTES, MAX_QUALITY = 40_000, 90
SHEET = "all.jpg"
COLUMNS, CELL_PX, LABEL_PX, FONT_PX = 5, 190, 28, 19
OUTSIDE = (24, 24, 28)  # where a camera sees nothing
OPTICS = ROOT / "examples" / "optics"
# Of the live page: a strip of small images, one below the other.
STRIP, STRIP_PX, STRIP_BYTES = PRESETS_FILE.parent / "page" / "lenses.jpg", 64, 32_000


def gallery_cameras() -> dict[str, CentralCamera]:
    """Camera of each model, in the order of `CAMERA_MODELS`."""
    first: dict[str, CentralCamera] = {}
    for camera in CAMERA_EXAMPLES.values():
        first.setdefault(camera.model_name, camera)
    return {
        model: first[model].scaled(
            LONGER_SIDE_PX / max(first[model].width_px, first[model].height_px)
        )
        for model in CAMERA_MODELS
    }


def presets(cameras: dict[str, CentralCamera]) -> str:
    """Parameters of all models, and the examples of optical systems that are one file each."""
    systems = {
        path.stem: table
        for path in sorted(OPTICS.glob("*.toml"))
        for table in [tomllib.loads(path.read_text(encoding="utf-8"))]
        if not any("file" in surface for surface in table["surfaces"])
    }
    lenses = {model: camera.parameters() for model, camera in cameras.items()}
    return json.dumps({"lens": lenses, "optics": systems}, indent=1) + "\n"


_DOMAIN = (
    r"^Domain[^:\n]*: (.+?)(?:[.;:]?\n\n|[.;:]\s|, (?:where|with|which|the rim)|(?<=\)), θ_fold)"
)


def page(cameras: dict[str, CentralCamera]) -> str:
    """README of the gallery."""
    parts = [
        "# Gallery\n\n"
        f"The scene `{SCENE}` from one viewpoint, through every camera model. Made by "
        "`make gallery` from the models' docstrings. Lenses look ahead, and cameras with a mirror "
        "look up into it: letters are readable in the one and mirrored in the other. `omnisim live "
        f"{SCENE}` has each one click away, [in a browser](../../../docs/how-to/live.md).\n\n"
        f"![all models]({SHEET})\n",
        "| model | camera | domain |\n| --- | --- | --- |",
    ]
    parts[1] += "".join(
        f"\n| [`{model}`](#{model}) | {_docstring(camera)[0].rstrip('.')} | {_domain(camera)} |"
        for model, camera in cameras.items()
    )
    parts[1] += "\n"
    for model, camera in cameras.items():
        title, text = _docstring(camera)
        seen = field_of_view(camera)
        parts.append(
            f"## {model}\n\n{title}\n\n![{model}]({model}.jpg)\n\n{_summary(seen)} "
            f"{_parameters(camera)}\n\n{text}\n\n{_table(camera)}\n"
        )
    return "\n".join(parts)


def _docstring(camera: CentralCamera) -> tuple[str, str]:
    """First line of a model's module, in one line, and the rest."""
    module = inspect.getmodule(type(camera))
    title, _, text = inspect.cleandoc((module and module.__doc__) or "").partition("\n\n")
    return " ".join(title.split()), text


def _table(camera: CentralCamera) -> str:
    """Parameters of a model with their meaning, those of its mirror among them."""
    keys = list(keys_of(table_of(type(camera))))
    keys = keys[2:] or keys  # all have a width and a height
    keys += [one for key in keys if key.inner for one in keys_of(key.inner.model)]
    rows = [f"| {key.name} | {key.help} |" for key in keys if not key.inner]
    return "\n".join(("| parameter | meaning |", "| --- | --- |", *rows))


def _domain(camera: CentralCamera) -> str:
    """First clause of a model's domain."""
    found = re.search(_DOMAIN, _docstring(camera)[1] + "\n\n", re.MULTILINE | re.DOTALL)
    return " ".join(found[1].split()) if found else ""


def _summary(seen: FieldOfView) -> str:
    degrees = [
        math.degrees(angle)
        for angle in (
            seen.horizontal_rad, seen.vertical_rad, seen.theta_max_rad, seen.theta_limit_rad
        )
    ]  # fmt: skip
    wide, high, largest, limit = (f"{angle + 0.0:.1f}°" for angle in degrees)
    return (
        f"In this image: {wide} × {high}, up to θ = {largest}, on {100.0 * seen.covered:.1f} % "
        f"of the pixels; the model ends at {limit}."
    )


def _parameters(camera: CentralCamera) -> str:
    parameters = ", ".join(
        f"{key} = {_short(value)}" for key, value in camera.parameters().items() if key != "model"
    )
    return f"Its camera: `{parameters}`."


def _short(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(map(_short, value)) + "]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def image_of(camera: CentralCamera) -> Image.Image:
    """Image of the scene by a camera."""
    sensor = OmniCamera(camera, polygons=None, supersampling=SUPERSAMPLING)
    with open_sensor(load_scene(SCENE), sensor) as renderer:
        frame = renderer.render(sensor.base_pose(VIEWPOINT_M, yaw_deg=YAW_DEG))
    pixels = np.where(frame.valid[..., None], frame.rgb, np.array(OUTSIDE, dtype=np.uint8))
    return Image.fromarray(pixels)


def _sheet(images: dict[str, Image.Image]) -> Image.Image:
    rows = math.ceil(len(images) / COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * CELL_PX, rows * (CELL_PX + LABEL_PX)), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(FONT_PX)
    for at, (model, image) in enumerate(images.items()):
        left, top = at % COLUMNS * CELL_PX, at // COLUMNS * (CELL_PX + LABEL_PX)
        small = image.copy()
        small.thumbnail((CELL_PX - 8, CELL_PX - 8), Image.Resampling.LANCZOS)
        corner = (
            left + (CELL_PX - small.width) // 2,
            top + LABEL_PX + (CELL_PX - small.height) // 2,
        )
        sheet.paste(small, corner)
        draw.text((left + CELL_PX // 2, top + LABEL_PX // 2), model, "black", font, anchor="mm")
    return sheet


def _strip(images: dict[str, Image.Image]) -> Image.Image:
    strip = Image.new("RGB", (STRIP_PX, STRIP_PX * len(images)), OUTSIDE)
    for at, image in enumerate(images.values()):
        small = image.copy()
        small.thumbnail((STRIP_PX, STRIP_PX), Image.Resampling.LANCZOS)
        strip.paste(
            small, ((STRIP_PX - small.width) // 2, (2 * at + 1) * STRIP_PX // 2 - small.height // 2)
        )
    return strip


def main() -> None:
    """Render all images and write the page; with --page only that."""
    FOLDER.mkdir(exist_ok=True)
    cameras = gallery_cameras()
    (FOLDER / "README.md").write_text(page(cameras), encoding="utf-8")
    PRESETS_FILE.write_text(presets(cameras), encoding="utf-8")
    if sys.argv[1:] == ["--page"]:
        return
    images = {}
    for model, camera in cameras.items():
        images[model] = image_of(camera)
        save_jpeg(images[model], FOLDER / f"{model}.jpg", MAX_BYTES, MAX_QUALITY)
        print(f"{model}: {camera.width_px} × {camera.height_px} px")
    save_jpeg(_sheet(images), FOLDER / SHEET, 4 * MAX_BYTES, MAX_QUALITY)
    save_jpeg(_strip(images), STRIP, STRIP_BYTES, MAX_QUALITY)
    print(f"{FOLDER.relative_to(ROOT)}: {len(images)} models")


if __name__ == "__main__":
    main()
