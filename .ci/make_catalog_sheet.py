"""Render the sheet of twelve cameras of the catalog: `python .ci/make_catalog_sheet.py FILE`."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from make_gallery import image_of
from pages import save_jpeg
from PIL import Image, ImageDraw, ImageFont

from omnisim.cameras.catalog.lens_catalog import CatalogEntry, find
from omnisim.cameras.models.field_of_view import angles_of_view

# Action cameras, drones, phones, and lenses of cinema.
NAMES = (
    "gopro/hero10-black/linear-5120x3840",
    "gopro/hero12-black/max-lens-2.0-4000x3000",
    "dji/osmo-action-3/4k-ultra-wideangle-4096x3072",
    "insta360/go/v3-2720x2720",
    "gopro/hero11-black/wide-3840x2160",
    "caddx/orca/1920x1080",
    "dji/goggles2-from-avata/o3-air-unit-1920x1080",
    "dji/mini-3-pro/3840x2160",
    "apple/iphone-15-pro-max/ultra-wide-3840x2160",
    "google/pixel-8/3840x2160",
    "sony/a7rii/ttartisan-7.5mm-f2-full-3840x2160",
    "sony/a7siii/sirui-35mm-anamorphic-3840x2160",
)
COLUMNS, WIDTH_PX, HEIGHT_PX, LABEL_PX, GAP_PX, FONT_PX = 4, 270, 203, 44, 10, 14
MAX_BYTES = 200_000


def tile_of(entry: CatalogEntry) -> Image.Image:
    """Image of the scene by a camera, with its name and angles of view below."""
    lens = entry.lens.scaled(min(WIDTH_PX / entry.lens.width_px, HEIGHT_PX / entry.lens.height_px))
    image = image_of(lens)
    tile = Image.new("RGB", (WIDTH_PX, image.height + LABEL_PX), "white")
    tile.paste(image, (0, 0))
    wide, high = (f"{math.degrees(angle):.0f}°" for angle in angles_of_view(entry.lens))
    mode = (entry.fields.lens, entry.fields.setting, f"{wide} by {high}")
    lines = f"{entry.fields.maker} {entry.fields.model}", ", ".join(filter(None, mode))
    draw, font = ImageDraw.Draw(tile), ImageFont.load_default(FONT_PX)
    draw.text((0, image.height + 5), lines[0], "black", font)
    draw.text((0, image.height + 23), lines[1], (90, 90, 100), font)
    return tile


def main(path: Path) -> None:
    """Write the sheet."""
    tiles = [tile_of(find(name)) for name in NAMES]
    rows = [tiles[at : at + COLUMNS] for at in range(0, len(tiles), COLUMNS)]
    heights = [max(tile.height for tile in row) + GAP_PX for row in rows]
    size = COLUMNS * (WIDTH_PX + GAP_PX) + GAP_PX, sum(heights) + GAP_PX
    sheet, top = Image.new("RGB", size, "white"), 0
    for row, height in zip(rows, heights, strict=True):
        top += height
        for column, tile in enumerate(row):
            sheet.paste(tile, (GAP_PX + column * (WIDTH_PX + GAP_PX), top - tile.height))
    save_jpeg(sheet, path, MAX_BYTES)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
