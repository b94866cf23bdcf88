"""Overlays: boxes where COCO has them, masks in the colors of the classes, names that are apart."""

import itertools

import numpy as np
import pytest

from omnisim.ground_truth.boxes import coco_image
from omnisim.ground_truth.label_names import ClassLabel, InstanceLabel, Labels
from omnisim.plots.overlays import MASK_SHARE, Captions, boxes_overlay, labels_overlay

LABELS = Labels(
    (ClassLabel(1, "chair", (250, 220, 40)), ClassLabel(2, "a long class name", (20, 60, 200))),
    (InstanceLabel(1, "chair_1", 1), InstanceLabel(2, "table", 2), InstanceLabel(3, "chair_2", 1)),
    "table",
)
GRAY = 90


def _scene(height, width):
    """Image, instances and classes with three rectangles, one of them in another."""
    instances = np.zeros((height, width), dtype=np.uint32)
    instances[height // 8 : height // 2, width // 8 : width // 2] = 1
    instances[height // 5 : height // 3, width // 5 : width // 3] = 2
    instances[-height // 3 :, -width // 4 :] = 3
    image = np.full((height, width, 3), GRAY, dtype=np.uint8)
    return image, instances, LABELS.class_of_instance[instances]


@pytest.mark.parametrize(("size", "times"), [((84, 84), 6), ((480, 640), 1), ((1200, 1200), 1)])
def test_boxes_are_those_of_coco_in_the_colors_of_the_classes(size, times):
    image, instances, _ = _scene(*size)
    drawn = boxes_overlay(image, instances, LABELS)
    assert drawn.shape == (times * size[0], times * size[1], 3)
    for one in coco_image(instances, LABELS, "")["annotations"]:
        left, top, width, height = (times * side for side in one["bbox"])
        color = LABELS.class_colors[one["category_id"]]
        border = drawn[top : top + height, left : left + width]
        for side in (border[0], border[-1], border[:, 0], border[:, -1]):
            assert (side == color).all(axis=-1).mean() > 0.6  # names may cross
        inside = border[times * 3 : -times * 3, times * 3 : -times * 3]
        assert (inside == GRAY).all(axis=-1).any()
    outside = drawn[size[0] * times // 2 + 60 : -size[0] * times // 3 - 60, : size[1] * times // 2]
    assert (outside == GRAY).all()


@pytest.mark.parametrize("size", [(84, 84), (480, 640), (1500, 1000)])
def test_masks_are_blended_with_the_image(size):
    image, _, classes = _scene(*size)
    drawn = labels_overlay(image, classes, LABELS)
    times = len(drawn) // size[0]
    seen = drawn[:: times or 1, :: times or 1]
    blended = np.rint((1 - MASK_SHARE) * GRAY + MASK_SHARE * LABELS.class_colors[[1, 2]])
    for number, color in zip((1, 2), blended, strict=True):
        assert (seen[classes == number] == color).all(axis=-1).mean() > 0.3
    corner = drawn[: times * size[0] // 10, : times * size[1] // 10]
    assert (corner == GRAY).all()


def test_names_neither_overlap_nor_leave_the_image():
    captions = Captions(np.zeros((300, 200, 3), np.uint8))
    random = np.random.default_rng(0)
    written = [
        captions.add(f"instance_{number}", (200, 30, 30), random.uniform(-50, 350, (3, 2)))
        for number in range(200)
    ]
    assert 10 < sum(written) == len(captions.rectangles) < 200
    for left, top, right, bottom in captions.rectangles:
        assert 0 <= left < right <= 200
        assert 0 <= top < bottom <= 300
    for one, other in itertools.combinations(captions.rectangles, 2):
        is_beside = one[2] <= other[0] or other[2] <= one[0]
        assert is_beside or one[3] <= other[1] or other[3] <= one[1]


def test_names_are_dark_on_bright_colors_and_bright_on_dark_ones():
    for color, ink in (((250, 220, 40), 0), ((20, 60, 200), 255)):
        captions = Captions(np.full((100, 200, 3), GRAY, np.uint8))
        captions.add("name", color, [(20, 20)])
        left, top, right, bottom = captions.rectangles[0]
        name = np.asarray(captions.image)[top:bottom, left:right]
        assert (name == ink).all(axis=-1).any()
        assert tuple(name[0, 0]) == color


def test_an_image_without_instances_stays():
    image, instances, classes = _scene(500, 500)
    nothing = np.zeros_like(instances)
    np.testing.assert_array_equal(boxes_overlay(image, nothing, LABELS), image)
    np.testing.assert_array_equal(labels_overlay(image, np.zeros_like(classes), LABELS), image)
