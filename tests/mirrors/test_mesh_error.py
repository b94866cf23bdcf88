import pytest

import omnisim.mirrors.tessellation as tessellation
from omnisim.mirrors import HyperbolicMirror, tessellate
from omnisim.mirrors.mesh_error import mesh_error

# Mean, 95 % and maximum in pixels at 360 × 360 of a mesh with rings equally spaced in the picture,
# computed by others for the paper's mirror and a rim at 105°.
EQUAL_RINGS = {
    16: (10.4, 19.0, 19.7),
    64: (2.55, 5.05, 5.39),
    256: (0.63, 1.23, 1.43),
    1024: (0.155, 0.302, 0.369),
    4096: (0.039, 0.075, 0.090),
}


@pytest.mark.parametrize("polygons", EQUAL_RINGS)
def test_equal_rings_have_the_known_error_and_ours_a_smaller_one(polygons, monkeypatch):
    mirror = HyperbolicMirror()
    ours = mesh_error(mirror, tessellate(mirror, polygons), 180.0)
    monkeypatch.setattr(tessellation, "RING_EXPONENT", 1.0)
    equal = mesh_error(mirror, tessellate(mirror, polygons), 180.0)
    # 5 %: they sampled pixels, we sample the area evenly
    assert equal == pytest.approx(EQUAL_RINGS[polygons], rel=0.05)
    assert ours.mean_px < 0.96 * equal.mean_px
    assert ours.percentile_95_px < 0.93 * equal.percentile_95_px
    assert ours.max_px < 0.93 * equal.max_px
