import numpy as np
import pytest

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_image
from omnisim.plots.contact_sheet import (
    GAP_PX,
    TITLE_PX,
    contact_sheet,
    magnified,
    save_contact_sheet,
)


def test_images_stand_pixel_for_pixel_below_their_titles(tmp_path):
    generator = np.random.default_rng(0)
    image = generator.integers(0, 256, (40, 60, 3), dtype=np.uint8)
    gray = generator.integers(0, 256, (30, 20), dtype=np.uint8)
    tiles = [("noise", image), ("gray", gray), ("large", magnified(gray, 2))]
    sheet = contact_sheet(tiles, 2)
    cell = np.array([60 + TITLE_PX + GAP_PX, 60 + GAP_PX])
    assert sheet.shape == (2 * cell[0] + GAP_PX, 2 * cell[1] + GAP_PX, 3)
    top = GAP_PX + TITLE_PX
    np.testing.assert_array_equal(sheet[top : top + 40, GAP_PX : GAP_PX + 60], image)
    left = GAP_PX + cell[1] + 20  # in the middle of its cell
    np.testing.assert_array_equal(sheet[top : top + 30, left : left + 20, 1], gray)
    title = sheet[GAP_PX:top, GAP_PX : GAP_PX + 60]
    assert title.min() < 100 < title.mean()  # dark letters on white
    save_contact_sheet(tmp_path / "sheet.png", tiles, 2)
    np.testing.assert_array_equal(read_image(tmp_path / "sheet.png")[0], sheet)


def test_long_titles_stay_in_their_cells():
    tiles = [("a title that is much longer than its image is wide", np.zeros((9, 80), np.uint8))]
    sheet = contact_sheet([*tiles, ("", tiles[0][1])], 2)
    dark = np.flatnonzero((sheet[GAP_PX : GAP_PX + TITLE_PX] < 128).any(axis=(0, 2)))
    assert dark.size
    assert dark.min() >= GAP_PX
    assert dark.max() < GAP_PX + 80 + 1


def test_titles_of_wide_sheets_can_be_read_on_a_page():
    """At 800 px a capital is 9 px high, also in a title that takes two lines."""
    tiles = [("H", np.zeros((9, 400), np.uint8))] * 3 + [
        ("H" * 9 + " " + "H" * 30, tile) for tile in [np.zeros((9, 400), np.uint8)]
    ]
    sheet = contact_sheet(tiles, 4)
    dark = (sheet[:, :408] < 128).any(axis=(1, 2))
    first, end = np.flatnonzero(dark)[0], np.flatnonzero(~dark[np.flatnonzero(dark)[0] :])[0]
    assert end * 800 / sheet.shape[1] >= 9
    two = (sheet[:, 3 * 408 :] < 128).any(axis=(1, 2))
    assert np.count_nonzero(np.diff(two[: sheet.shape[0] - 17].astype(int)) == 1) == 2
    assert first > 0


def test_a_sheet_of_nothing_is_refused():
    with pytest.raises(OutputError, match="expected at least one"):
        contact_sheet([], 3)
