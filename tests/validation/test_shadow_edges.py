import math

import numpy as np
import pytest

from omnisim.validation.checks.lit_scenes import edge_distance_px, inside_surfaces, lit_share

SIZE_PX = 40


def half_plane(at_px: float, angle_deg: float = 0.0) -> np.ndarray:
    """Shares of light right of a line near the middle, two pixels wide."""
    v, u = np.indices((SIZE_PX, SIZE_PX)) - 0.5 * SIZE_PX
    angle = math.radians(angle_deg)
    away = u * math.cos(angle) + v * math.sin(angle) - at_px
    return np.clip(0.5 * away + 0.5, 0.0, 1.0).astype(np.float32)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0])
@pytest.mark.parametrize("shift_px", [0.0, 0.4, 1.0, 3.0])
def test_distance_is_the_shift_of_a_straight_edge(angle_deg, shift_px):
    where = np.zeros((SIZE_PX, SIZE_PX), bool)
    where[10:-10, 10:-10] = True  # so that ends at the image's edge do not count
    found = edge_distance_px(
        half_plane(0.2, angle_deg), half_plane(0.2 + shift_px, angle_deg), where
    )
    assert found == pytest.approx(shift_px, abs=0.13)  # edges are whole eighths of a pixel


def test_images_without_counted_edges_have_no_distance():
    assert math.isnan(edge_distance_px(half_plane(0.0), half_plane(0.0), np.zeros((40, 40), bool)))


def test_shares_are_of_the_light_without_shadows():
    unshadowed = np.full((2, 2, 3), 0.5, np.float32)
    assert np.allclose(lit_share(0.5 * unshadowed, unshadowed), 0.5)
    assert (lit_share(np.zeros_like(unshadowed), 0.0 * unshadowed) == 0.0).all()


def test_edges_of_objects_bends_and_dark_surfaces_do_not_count():
    instances = np.zeros((20, 40), int)
    instances[:, 20:] = 1
    normals = np.zeros((20, 40, 3))
    normals[..., 2] = 1.0
    normals[:, 30:] = (1.0, 0.0, 0.0)
    bright = np.ones((20, 40, 3), np.float32)
    bright[:, :10] = 0.0
    row = inside_surfaces(instances, normals, bright)[10]
    assert row[[13, 24, 25, 35]].all()
    assert not row[[*range(10), *range(18, 22), *range(28, 32)]].any()
