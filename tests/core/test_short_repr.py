"""Numbers as text: rounded to what is printed, and never a negative zero."""

import numpy as np
import pytest

from omnisim.core.short_repr import number_text, point_text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-1.13687e-13, "0"),
        (-0.0, "0"),
        (-4e-7, "0"),
        (-6e-7, "-1e-06"),
        (1.5, "1.5"),
        (-123456.789, "-123457"),
        (np.float32(0.1), "0.1"),
        (179.9999999999, "180"),
        (float("inf"), "inf"),
    ],
)
def test_numbers(value, text):
    assert number_text(value) == text


def test_points():
    assert point_text((-1e-17, 0.25, -0.004), 3, 2) == "(0, 0.25, 0)"
    assert point_text(np.array([1.0, -2.0])) == "(1, -2)"
