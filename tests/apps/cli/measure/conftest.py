"""Exposure series of a simulated camera."""

import pytest

from omnisim.core.files.image_files import write_numbers
from tests.measurement.response.test_response import TIMES_S, series


def write_series(folder, encode):
    """Write an image per exposure time, to a folder of its own."""
    for time_s, image in zip(TIMES_S, series(encode), strict=True):
        exposure = folder / f"{1e3 * time_s:g}ms"
        exposure.mkdir(parents=True)
        write_numbers(exposure / "a.png", image)


@pytest.fixture
def response_series(tmp_path):
    """Folder `series` of images with a gamma of 2."""
    write_series(tmp_path / "series", lambda light: light**0.5)
    return tmp_path / "series"
