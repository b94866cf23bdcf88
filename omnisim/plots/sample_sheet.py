"""Sheets of a data set's samples: images and channels with names and scales."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from omnisim.core.arrays import Bytes
from omnisim.ground_truth.label_names import Labels
from omnisim.ground_truth.previews import legend, preview

GAP_PX, LINE_PX, FONT_PX = 6, 15, 11
INK = (30, 30, 30)


@dataclass(frozen=True, eq=False)
class SampleTiles:
    """Images of a sample, from top to bottom."""

    title: str
    tiles: Sequence[tuple[str, Bytes]]  # captions and images (height, width, 3) uint8


def channel_tile(
    name: str, values: NDArray[Any], labels: Labels | None = None
) -> tuple[str, Bytes]:
    """Caption and false-color image of a channel; the caption has the limits of a numeric scale."""
    key = legend(name, values, labels)
    caption = name
    if key["kind"] == "ramp":
        caption = f"{name} {key['low']:.2g} to {key['high']:.2g} {key['unit']}"
    return caption, preview(name, values, labels)


def sample_sheet(samples: Sequence[SampleTiles]) -> Bytes:
    """Sheet (height, width, 3) of samples, approximately as many columns as rows."""
    font = ImageFont.load_default(FONT_PX)
    tiles = [tile for sample in samples for tile in sample.tiles]
    texts = [*(sample.title for sample in samples), *(caption for caption, _ in tiles)]
    widths = [math.ceil(font.getlength(text)) for text in texts]
    widths += [image.shape[1] for _, image in tiles]
    caption_px = LINE_PX + GAP_PX
    heights = [sum(image.shape[0] + caption_px for _, image in each.tiles) for each in samples]
    columns = math.ceil(math.sqrt(len(samples)))
    width, height = max(widths) + GAP_PX, max(heights) + LINE_PX + GAP_PX
    size = columns * width + GAP_PX, math.ceil(len(samples) / columns) * height + GAP_PX
    sheet = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(sheet)
    for index, sample in enumerate(samples):
        row, column = divmod(index, columns)
        left, top = GAP_PX + column * width, GAP_PX + row * height
        draw.text((left, top), sample.title, INK, font, stroke_width=0.3)
        top += LINE_PX
        for caption, image in sample.tiles:
            draw.text((left, top), caption, INK, font)
            pixels = Image.fromarray(np.ascontiguousarray(image[..., :3]))
            sheet.paste(pixels, (left, top + LINE_PX))
            top += image.shape[0] + caption_px
    return np.asarray(sheet)
