"""Poses from positions and angles."""

import numpy as np
import pytest

import omnisim


@pytest.mark.parametrize("make", [omnisim.pose, omnisim.OmniCamera().base_pose])
def test_angles_are_given_by_name_only(make):
    """The two functions list their angles in different orders."""
    with pytest.raises(TypeError, match="positional argument"):
        make((0.0, 0.0, 1.0), 30.0)
    ahead = make((0.0, 0.0, 1.0), yaw_deg=90.0)[:3, 0]
    np.testing.assert_allclose(ahead, (0.0, 1.0, 0.0), atol=1e-15)
