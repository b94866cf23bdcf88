"""CIEDE2000 against the pairs that its authors published."""

import numpy as np
import pytest

from omnisim.validation.checks.materials import ciede2000, lab_from_linear

# Sharma, Wu and Dalal, 2005, table 1: pairs 1, 4, 7, 9, 13, 17, 21, 25, 31 and 34
PAIRS = [
    ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
    ((50, -1.3802, -84.2814), (50, 0, -82.7485), 1.0000),
    ((50, 0, 0), (50, -1, 2), 2.3669),
    ((50, 2.4900, -0.0010), (50, -2.4900, 0.0009), 7.1792),
    ((50, -0.0010, 2.4900), (50, 0.0009, -2.4900), 4.8045),
    ((50, 2.5, 0), (73, 25, -18), 27.1492),
    ((50, 2.5, 0), (50, 3.1736, 0.5854), 1.0000),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((90.8027, -2.0831, 1.4410), (91.1528, -1.6435, 0.0447), 1.4441),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
]


@pytest.mark.parametrize(("one", "other", "expected"), PAIRS)
def test_published_pairs(one, other, expected):
    found = ciede2000(np.array(one, float), np.array(other, float))
    assert found == pytest.approx(expected, abs=1e-4)


def test_white_and_black():
    found = lab_from_linear(np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]))
    assert found == pytest.approx(np.array([[100.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), abs=1e-9)
