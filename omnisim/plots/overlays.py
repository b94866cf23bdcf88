"""Overlays: boxes of the visible instances, or masks of the classes, with names, on an image."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy import ndimage

from omnisim.core.arrays import Bools, Bytes
from omnisim.ground_truth.boxes import coco_image
from omnisim.ground_truth.label_names import NOTHING, Labels

READABLE_PX = 480  # smaller images are magnified by a whole number to at least this short side
MASK_SHARE = 0.5  # of a class's color in its mask
MIN_BOX_PX = 3  # shorter sides of boxes that are drawn, in pixels of the image
_FONT_PX, _SIDE_PER_FONT, _SIDE_PER_LINE = 13, 55, 400
_SEARCHED_PX = 400  # larger masks are searched for room with coarser steps
_BRIGHT = 140  # luma above which text is black
Color = tuple[int, int, int]
Rectangle = tuple[int, int, int, int]  # left, top, right, bottom


class Captions:
    """Names on an image, none of which covers another.

    Args:
        pixels: (height, width, 3) image to draw on.
    """

    def __init__(self, pixels: Bytes):
        self.image = Image.fromarray(np.ascontiguousarray(pixels))
        self.draw = ImageDraw.Draw(self.image)
        self.rectangles: list[Rectangle] = []  # of the names
        short_px = min(self.image.size)
        self.line_px = max(1, round(short_px / _SIDE_PER_LINE))
        font_px = max(_FONT_PX, round(short_px / _SIDE_PER_FONT))
        self._font = ImageFont.load_default(font_px)
        self._pad_px = max(1, font_px // 6)

    def size_px(self, text: str) -> tuple[int, int]:
        """Width and height of a name with its background."""
        width, height = self._font.getlength(text), self._font.getbbox("Åg")[3]
        return math.ceil(width) + 2 * self._pad_px, math.ceil(height) + self._pad_px

    def add(self, text: str, color: Color, corners: Sequence[tuple[float, float]]) -> bool:
        """Write a name at the first of some places that is free; False: none is.

        Args:
            color: background.
            corners: top left corners (x, y), which are moved into the image.
        """
        width, height = self.size_px(text)
        for x, y in corners:
            left = max(0, min(round(x), self.image.width - width))
            top = max(0, min(round(y), self.image.height - height))
            right, bottom = left + width, top + height
            if not any(
                left < other[2] and other[0] < right and top < other[3] and other[1] < bottom
                for other in self.rectangles
            ):
                break
        else:
            return False
        self.rectangles.append((left, top, right, bottom))
        red, green, blue = color
        ink = "black" if 0.299 * red + 0.587 * green + 0.114 * blue > _BRIGHT else "white"
        self.draw.rectangle((left, top, left + width - 1, top + height - 1), fill=color)
        self.draw.text((left + self._pad_px, top), text, ink, self._font)
        return True


def boxes_overlay(rgb: Bytes, instances: NDArray[np.integer[Any]], labels: Labels) -> Bytes:
    """Image with the 2-D boxes of COCO files, in the colors of the classes, and instances' names.

    Names of small boxes are left out where others cover all their sides.

    Args:
        rgb: (height, width, 3) image.
        instances: (height, width) channel `instance`.
    """
    times = _magnification(rgb)
    captions = Captions(_magnified(rgb, times))
    found = coco_image(instances, labels, "")["annotations"]
    shown = [each for each in found if min(each["bbox"][2:]) >= MIN_BOX_PX]
    shown.sort(key=lambda each: -each["bbox"][2] * each["bbox"][3])
    line = captions.line_px
    boxes = []
    for annotation in shown:
        x, y, width, height = (times * side for side in annotation["bbox"])
        color = _color(labels, annotation["category_id"])
        corners = (x, y, x + width - 1, y + height - 1)
        captions.draw.rectangle(corners, outline=color, width=line)
        boxes.append((annotation["instance_name"], color, corners))
    for name, color, (left, top, right, bottom) in boxes:
        width, height = captions.size_px(name)
        sides = (left, right + 1 - width)
        rows = (top - height, top + line, bottom + 1, bottom - line - height)
        captions.add(name, color, [(x, y) for y in rows for x in sides])
    return np.asarray(captions.image)


def labels_overlay(rgb: Bytes, classes: NDArray[np.integer[Any]], labels: Labels) -> Bytes:
    """Image blended with the masks of its classes, with edges and names.

    Args:
        rgb: (height, width, 3) image.
        classes: (height, width) channel `semantic`.
    """
    times = _magnification(rgb)
    colors = labels.class_colors.take(classes, axis=0).astype(np.float32)
    blended = np.where(
        (classes == NOTHING)[..., None], rgb, (1.0 - MASK_SHARE) * rgb + MASK_SHARE * colors
    )
    image = _magnified(np.rint(blended).astype(np.uint8), times)
    numbers = _magnified(classes, times)
    edges = np.zeros(numbers.shape, dtype=np.bool_)
    edges[1:] |= numbers[1:] != numbers[:-1]
    edges[:, 1:] |= numbers[:, 1:] != numbers[:, :-1]
    image[edges] = labels.class_colors.take(numbers[edges], axis=0)
    captions = Captions(image)
    names = {each.id: each.name for each in labels.classes}
    present, counts = np.unique(classes[classes != NOTHING], return_counts=True)
    for number in present[np.argsort(-counts)].tolist():
        x, y = _middle(numbers == number)
        width, height = captions.size_px(names[number])
        left, top = x - 0.5 * width, y - 0.5 * height
        corners = [(left, top + row * height) for row in (0, -1, 1)]
        captions.add(names[number], _color(labels, number), corners)
    return np.asarray(captions.image)


def _magnification(rgb: Bytes) -> int:
    return math.ceil(READABLE_PX / int(min(rgb.shape[:2])))


def _magnified(values: NDArray[Any], times: int) -> NDArray[Any]:
    """Values (height, width, …), each repeated `times` times along both axes."""
    return values.repeat(times, axis=0).repeat(times, axis=1)


def _color(labels: Labels, class_id: int) -> Color:
    red, green, blue = labels.class_colors[class_id].tolist()
    return red, green, blue


def _middle(mask: Bools) -> tuple[float, float]:
    """Point (x, y) of a mask (height, width) that is farthest from its edges."""
    step = math.ceil(max(mask.shape) / _SEARCHED_PX)
    coarse = mask[::step, ::step]
    if not coarse.any():
        row, column = np.argwhere(mask)[0]
        return float(column), float(row)
    inside_px = ndimage.distance_transform_edt(np.pad(coarse, 1))
    row, column = np.unravel_index(int(inside_px.argmax()), inside_px.shape)
    return float(step * (column - 1)), float(step * (row - 1))
