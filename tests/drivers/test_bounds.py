"""Bounds of what two drivers may draw differently."""

import numpy as np
import pytest

from tests.drivers.bounds import compare, difference


@pytest.fixture
def files(tmp_path):
    generator = np.random.default_rng(3)
    images = {
        "rgb": generator.integers(0, 255, (2, 50, 50, 3), dtype=np.uint8),
        "range": generator.uniform(1.0, 9.0, (2, 50, 50)).astype(np.float32),
        "instance": generator.integers(0, 9, (2, 50, 50)),
        "images": np.array(2),
        "unlike itself": np.array(0),
    }

    def write(folder, **changes):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / "case.npz"
        np.savez(path, **images | changes)
        return path

    return images, write


def test_the_same_images_are_within_the_bounds(files, tmp_path):
    _, write = files
    found = difference(write("one"), write("other"))
    assert found.is_within_bounds
    assert found[:4] == (2, 0, 0, 0.0)
    assert compare(tmp_path / "one", tmp_path / "other", print)


@pytest.mark.parametrize(
    ("name", "pixels", "change", "within"),
    [
        ("rgb", 5, 1, True),
        ("rgb", 6, 1, False),
        ("rgb", 1, 2, False),
        ("instance", 6, 1, False),
        ("range", 5, 0.1, True),
        ("range", 6, 0.1, False),
        ("range", 5000, 1e-7, True),
        ("range", 1, np.inf, False),
        ("unlike itself", 1, 1, False),
    ],
)
def test_what_differs_in_a_thousandth_of_the_pixels(files, name, pixels, change, within):
    images, write = files
    changed = images[name].copy()
    flat = changed.reshape(min(5000, changed.size), -1)
    flat[:pixels] = flat[:pixels] + np.asarray(change).astype(changed.dtype)
    found = difference(write("one"), write("other", **{name: changed}))
    assert found.is_within_bounds == within, found


def test_a_folder_without_drawings_says_so(tmp_path):
    with pytest.raises(FileNotFoundError, match="no case drawn in both"):
        compare(tmp_path, tmp_path, print)
