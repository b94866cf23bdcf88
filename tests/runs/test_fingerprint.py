"""Fingerprints: equal contents, equal fingerprints, and no others."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.files.sources import fingerprint
from omnisim.scene.model import AlphaMode, Material
from tests.scenes import room, scene_of


def test_equal_contents_have_equal_fingerprints():
    assert fingerprint(scene_of([room()])) == fingerprint(scene_of([room()]))
    assert fingerprint({"a": (1, 2.5, None, "x")}) == fingerprint({"a": (1, 2.5, None, "x")})
    strided = np.arange(12.0).reshape(3, 4)[:, ::2]
    assert fingerprint(strided) == fingerprint(strided.copy())


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, 1.0),
        (1, "1"),
        (True, 1),
        ((1, 2), (12,)),
        ((1, (2, 3)), ((1, 2), 3)),
        ({"a": 1}, {"b": 1}),
        (np.zeros(4), np.zeros((2, 2))),
        (np.zeros(2, dtype="f4"), np.zeros(1, dtype="f8")),
        (Material(alpha_mode=AlphaMode.MASK), Material(alpha_mode=AlphaMode.BLEND)),
        (room(), dataclasses.replace(room(), positions=np.nextafter(room().positions, 9.0))),
    ],
)
def test_other_contents_have_other_fingerprints(one, other):
    assert fingerprint(one) != fingerprint(other)
    with pytest.raises(TypeError, match="set"):
        fingerprint({one.__class__})
