"""Sheets of samples: images pixel for pixel, below their names and scales."""

import numpy as np

from omnisim.plots.sample_sheet import GAP_PX, LINE_PX, SampleTiles, channel_tile, sample_sheet


def test_captions_have_the_scale():
    caption, colors = channel_tile("range", np.array([[1.0, 2.0], [4.0, np.inf]], np.float32))
    assert caption == "range 1 to 3.9 m"  # percentiles
    assert colors.shape == (2, 2, 3)
    assert channel_tile("instance", np.array([[0, 1]], np.uint32))[0] == "instance"


def test_images_are_below_their_captions():
    images = [np.full((20, 30, 3), (200, level, 30), np.uint8) for level in (10, 90, 170)]
    samples = [
        SampleTiles("0: a title that is wider than the images", [("rgb", images[0])]),
        SampleTiles("1", [("rgb", images[1]), ("range 1 to 4 m", images[2])]),
    ]
    sheet = sample_sheet(samples)
    for level in (10, 90, 170):
        rows, columns = np.nonzero((sheet == (200, level, 30)).all(axis=-1))
        assert (np.ptp(rows), np.ptp(columns)) == (19, 29)
    top = GAP_PX + 2 * LINE_PX
    np.testing.assert_array_equal(sheet[top : top + 20, GAP_PX : GAP_PX + 30], images[0])
    assert (sheet[: GAP_PX + LINE_PX] < 100).any()  # letters
