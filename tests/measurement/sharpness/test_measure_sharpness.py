"""Sharpness over the field, against lenses in closed form and omnisim's own degradations."""

import numpy as np
import pytest

from omnisim.cameras.optics.system_calibration import BoardCorners
from omnisim.core.errors import MeasurementError
from omnisim.core.srgb import srgb_from_linear
from omnisim.measurement.sharpness import measure_sharpness
from omnisim.rendering.camera.degradations import ChromaticAberration, Encoding, PointSpread
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.validation.checks.measured.sharpness import AnalyticLens, gaussian, true_mtf50
from tests.measurement.sharpness.edges import edge_image

LENS = AnalyticLens((600, 480), (0.5, 0.1, 0.5), (0.5, 0.0, 0.2), (0.3, 0.5), (0.0, -0.7))
SHARP = AnalyticLens((600, 480), (0.02,), (0.02,), (), ())


@pytest.fixture(scope="module")
def chart():
    return LENS.chart(noise=0.004)


@pytest.fixture(scope="module")
def lens(chart):
    return measure_sharpness([chart])


def polynomial(coefficients, radius):
    return np.polynomial.polynomial.polyval(radius, (0.0, *coefficients))


def test_mtf50_of_a_lens_over_the_field(lens):
    """3 %, as the curve says it for radial and tangential edges; and each edge but for noise."""
    for radius_px, radial_px, tangential_px in lens.point_spread.widths_px:
        radius = radius_px / LENS.unit_px
        for width_px, true in ((radial_px, LENS.radial_px), (tangential_px, LENS.tangential_px)):
            true_px = np.polynomial.polynomial.polyval(radius, true)
            mtf50 = true_mtf50(gaussian(width_px), 0.0)
            assert mtf50 == pytest.approx(true_mtf50(gaussian(true_px), 0.0), rel=0.03)
    assert len(lens.edges) > 30
    for edge in lens.edges:
        true_px = float(LENS.widths_px(edge.center_px - LENS.center_px, edge.normal))
        angle_deg = np.degrees(np.arctan2(edge.normal[1], edge.normal[0]))
        expected = true_mtf50(gaussian(true_px), angle_deg)
        assert edge.mtf50 == pytest.approx(expected, abs=4.5 * edge.mtf50_sigma + 0.02 * expected)


def test_lateral_color_of_a_lens(lens):
    color = lens.chromatic_aberration
    for radius in (0.2, 0.5, 0.8, 1.0, 1.2):
        for measured, true in (
            (color.red_offsets_px, LENS.red_px), (color.blue_offsets_px, LENS.blue_px)
        ):  # fmt: skip
            error_px = polynomial(measured, radius) - polynomial(true, radius)
            assert abs(error_px) < 0.02


def test_quantities_have_standard_deviations(lens):
    names = [quantity.name for quantity in lens.quantities]
    for name, count in (("mtf50", 3), ("rise", 3), ("radial", 7), ("tangential", 7), ("red", 2)):
        assert sum(one.startswith(f"{name} ") for one in names) == count
    assert all(
        0.0 < quantity.sigma < 0.2 * abs(quantity.value) + 0.02 for quantity in lens.quantities
    )
    assert not lens.unobservable


@pytest.mark.slow
def test_drawn_lens_measures_the_same():
    """Numbers of the degradations, found again in the image that they make."""
    geometry = ImageGeometry(600, 480, (299.5, 239.5))
    spread = PointSpread(((0.0, 0.45, 0.45), (150.0, 0.6, 0.5), (380.0, 1.3, 0.8)))
    color = ChromaticAberration(red_offsets_px=(0.2, 0.6), blue_offsets_px=(0.0, 0.0, -0.8))
    image = np.ones((480, 600, 4), dtype=np.float32)
    image[..., :3] = SHARP.chart() / 65535.0
    image = color.apply(spread.apply(image, geometry), geometry)
    measured = measure_sharpness([image[..., :3]])
    radii, radial, tangential = np.array(spread.widths_px).T
    for radius_px, radial_px, tangential_px in measured.point_spread.widths_px[1:-1]:
        for width_px, true in ((radial_px, radial), (tangential_px, tangential)):
            expected = true_mtf50(gaussian(np.interp(radius_px, radii, true)), 0.0)
            assert true_mtf50(gaussian(width_px), 0.0) == pytest.approx(expected, rel=0.05)
    for radius in (0.3, 0.7, 1.1):
        for name in ("red_offsets_px", "blue_offsets_px"):
            found = polynomial(getattr(measured.chromatic_aberration, name), radius)
            assert found == pytest.approx(polynomial(getattr(color, name), radius), abs=0.02)


def test_gamma_encoded_values_are_refused_or_linearized(chart, lens):
    encoded = np.rint(65535.0 * srgb_from_linear(chart / 65535.0)).astype(np.uint16)
    with pytest.raises(MeasurementError, match=r"% wider on one half, as in gamma-encoded values"):
        measure_sharpness([encoded])
    linear = measure_sharpness([encoded], encoding=Encoding(gamma="srgb"))
    mtf50 = [one.mtf50_sigma for one in lens.edges]
    assert np.mean([edge.mtf50 for edge in linear.edges]) == pytest.approx(
        np.mean([edge.mtf50 for edge in lens.edges]), abs=max(mtf50)
    )


def test_squares_of_a_board():
    """Edges between neighboring corners; the diagonals have none."""
    side, angle = 40.0, np.radians(7.0)
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
    u, v = np.meshgrid(*2 * [np.arange(1280) / 4.0 - 0.375])  # 4 × 4 samples a pixel
    x, y = np.tensordot(turn.T, np.stack((u - 30.0, v - 5.0)), axes=1) / side
    fine = ((np.floor(x) + np.floor(y)) % 2.0).reshape(320, 4, 320, 4).mean(axis=(1, 3))
    image = np.ones((320, 320, 4), dtype=np.float32)
    image[..., :3] = (0.1 + 0.7 * fine)[..., None]
    image = PointSpread(((0.0, 0.9, 0.9),)).apply(image, ImageGeometry(320, 320, (160, 160)))
    grid = np.stack(np.meshgrid(np.arange(1, 6), np.arange(1, 6)), axis=-1).reshape(-1, 2)
    board = BoardCorners(0.03 * grid, side * grid @ turn.T + (30.0, 5.0))
    measured = measure_sharpness([image[..., 0]], boards=[board])
    assert len(measured.edges) == 40
    for edge in measured.edges:
        assert np.sqrt(edge.variance_px2) == pytest.approx(0.9, rel=0.03)
    reasons = {one.name: one.reason for one in measured.unobservable}
    assert "one channel" in reasons["lateral color"]


EDGE = edge_image(gaussian(0.8), 9.0)


@pytest.mark.parametrize(
    ("images", "message"),
    [
        ([], "got none"),
        ([np.full((80, 80), 0.5)], "no edges found: photograph slanted"),
        ([EDGE, EDGE[:70]], "b: expected images of one size, 80 × 80 px, got"),
        ([edge_image(gaussian(0.8), 0.0)], "are slanted by less than 2° to rows or columns"),
        ([np.uint8(np.rint(255.0 * np.minimum(1.6 * EDGE, 1.0)))], "clipped at the largest or"),
        ([np.zeros((8, 8, 2))], "expected one or three channels"),
        ([np.full((80, 80), np.nan)], "expected finite values"),
    ],
)
def test_other_images_are_refused(images, message):
    with pytest.raises(MeasurementError, match=message):
        measure_sharpness(images, names=["a", "b"][: len(images)])


def test_what_the_edges_do_not_show_is_named():
    sharp = measure_sharpness([edge_image(gaussian(0.01), 9.0)])
    assert sharp.point_spread is None
    names = [one.name for one in sharp.unobservable]
    assert "point_spread" in names
    assert "difference of radial and tangential width" in names
    assert "sharpness of the outer field" in names
