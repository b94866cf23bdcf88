"""Sheets of a data set's samples: images and channels with names and scales."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from omnisim.ground_truth.label_names import Labels
from omnisim.ground_truth.previews import legend, preview

GAP_PX, LINE_PX, FONT_PX = 6, 15, 11
INK = (30, 30, 30)


@dataclass(frozen=True, eq=False)
class SampleTiles:
    """Images of a sample, from top to bottom.

    Attributes:
        title: title of the sample.
        tiles: captions and images (height, width, 3) uint8.
    """

    title: str
    tiles: Sequence[tuple[str, NDArray[np.uint8]]]


def channel_tile(
    name: str, values: NDArray[Any], labels: Labels | None = None
) -> tuple[str, NDArray[np.uint8]]:
    """Caption and false-color image of a channel; the caption has the limits of a numeric scale."""
    key = legend(name, values, labels)
    caption = name
    if key["kind"] == "ramp":
        caption = f"{name} {key['low']:.2g} to {key['high']:.2g} {key['unit']}"
    return caption, preview(name, values, labels)


def sample_sheet(samples: Sequence[SampleTiles]) -> NDArray[np.uint8]:
    """Sheet (height, width, 3) of samples, approximately as many columns as rows."""
    font = ImageFont.load_default(FONT_PX)
    texts = [text for one in samples for text in (one.title, *(tile[0] for tile in one.tiles))]
    widths = [math.ceil(font.getlength(text)) for text in texts]
    widths += [image.shape[1] for one in samples for _, image in one.tiles]
    heights = [sum(image.shape[0] + LINE_PX + GAP_PX for _, image in one.tiles)
               for one in samples]  # fmt: skip
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
            sheet.paste(
                Image.fromarray(np.ascontiguousarray(image[..., :3])), (left, top + LINE_PX)
            )
            top += image.shape[0] + LINE_PX + GAP_PX
    return np.asarray(sheet)
