"""Misaligned mirrors measured from boards: truth within the deviations, outliers, refusals."""

import numpy as np
import pytest

from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison import locate_board
from omnisim.measurement.geometry import BoardView, measure_optics
from tests.cameras.optics.boards.test_calibrate import MIRROR, _changed, boards_of

TRUE = {"decenter_m": [0.0008, -0.0005, 0.0], "tilt_deg": [1.2, 0.0, 0.0]}
FREE = ["surfaces.0.decenter_m.0", "surfaces.0.decenter_m.1", "surfaces.0.tilt_deg.0"]
SIGMA_PX = 0.05


@pytest.fixture(scope="module")
def system():
    return parse_optics(_changed(MIRROR, TRUE))


@pytest.fixture(scope="module")
def views(system):
    random = np.random.default_rng(6)
    return [
        BoardView(
            f"{index}.png",
            one.points_m,
            one.pixels_px + SIGMA_PX * random.normal(size=one.pixels_px.shape),
        )
        for index, one in enumerate(boards_of(system, 6))
    ]


@pytest.mark.slow
def test_a_misaligned_mirror_is_measured_without_an_image_of_another_board(views):
    strange = BoardView("other.png", views[0].points_m * (1.05, 1.0), views[0].pixels_px + 0.01)
    measured = measure_optics(MIRROR, FREE, [*views, strange])
    assert [one.name for one in measured.rejected] == ["other.png"]
    assert "off a lens that fits the others" in measured.rejected[0].reason
    assert measured.rms_px == pytest.approx(SIGMA_PX * np.sqrt(2.0), rel=0.15)
    assert measured.rms_px < measured.held_out_rms_px < 1.3 * SIGMA_PX * np.sqrt(2.0)
    truth = (*TRUE["decenter_m"][:2], TRUE["tilt_deg"][0])
    for quantity, true in zip(measured.quantities, truth, strict=True):
        assert abs(quantity.value - true) < 4.0 * quantity.sigma
    assert [one.unit for one in measured.quantities] == ["m", "m", "°"]


def test_a_board_is_located_before_a_mirror(system, views):
    placed = locate_board(system, views[0])
    errors = placed.pixels(views[0].points_m).positions_px - views[0].pixels_px
    assert np.sqrt(np.mean(np.square(errors))) < 1.2 * SIGMA_PX


def test_too_few_images_are_refused(views):
    with pytest.raises(MeasurementError, match="4 images with a usable board: expected at least 5"):
        measure_optics(MIRROR, FREE, views[:4])
