"""Blur, scales, colors and dirt against what is known without the code."""

import numpy as np
import pytest

from omnisim.core.errors import OpticsError
from omnisim.rendering.camera.degradations import (
    Bayer,
    ChromaticAberration,
    Defocus,
    Dirt,
    Jpeg,
    PointSpread,
    WhiteBalance,
)
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.point_spread import sampled_widths_px
from tests.rendering.camera.degradations.images import GEOMETRY, on_gpu, random_image

PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")
LARGE = ImageGeometry(96, 96, (47.5, 47.5))
SQUARE = ImageGeometry(64, 64, (31.5, 31.5))


def _dark(geometry=SQUARE):
    image = np.zeros((geometry.height_px, geometry.width_px, 4), dtype=np.float32)
    image[..., 3] = 1.0
    return image


@pytest.mark.parametrize("radius_px", [0.5, 1.0, 1.7, 8.0])
def test_a_point_spreads_to_the_disc(context, radius_px):
    """Against the disc's area in each pixel, from 31² points a pixel; 2 % of the peak."""
    image = _dark()
    image[30, 33, :3] = 1.0
    drawn = on_gpu(context, [image], optics=Defocus(radius_px, radius_px).steps(SQUARE))[..., 1]
    fine = (np.arange(64 * 31) + 0.5) / 31.0 - 0.5
    inside = (fine[None, :] - 33.0) ** 2 + (fine[:, None] - 30.0) ** 2 <= radius_px**2
    disc = inside.reshape(64, 31, 64, 31).mean(axis=(1, 3))
    disc /= disc.sum()
    assert np.abs(drawn - disc).max() <= 0.02 * disc.max()
    assert drawn.sum() == pytest.approx(1.0, abs=1e-5)
    v, u = np.mgrid[:64, :64]
    squared = (u - 33.0) ** 2 + (v - 30.0) ** 2
    width, wanted = (np.sqrt((kernel * squared).sum()) for kernel in (drawn, disc))
    assert width == pytest.approx(wanted, rel=0.02, abs=1e-6)


def test_defocus_grows_towards_the_rim(context):
    """A point on the rim spreads as wide as one in focus does not."""
    image = _dark()
    image[32, 32, :3] = image[32, 62, :3] = 1.0
    drawn = on_gpu(context, [image], optics=Defocus(0.0, 3.0).steps(SQUARE))
    assert drawn[32, 32, 0] == 1.0
    assert np.count_nonzero(drawn[:, 52:, 0]) > 20


@pytest.mark.parametrize("widths_px", [(1.3, 1.3), (2.5, 1.3), (1.4, 2.5)])
def test_a_point_spreads_to_the_normal_distribution(context, widths_px):
    """Density along the radius and across it, at a point to the lower right of the center."""
    image = _dark(LARGE)
    image[70, 80, :3] = 1.0
    spread = PointSpread(((0.0, *widths_px),))
    drawn = on_gpu(context, [image], optics=spread.steps(LARGE))[..., 1]
    outward = np.array((80.0 - 47.5, 70.0 - 47.5))
    outward /= np.hypot(*outward)
    v, u = np.mgrid[:96, :96]
    radial = (u - 80.0) * outward[0] + (v - 70.0) * outward[1]
    across = (v - 70.0) * outward[0] - (u - 80.0) * outward[1]
    for offset, width_px in ((radial, widths_px[0]), (across, widths_px[1])):
        measured = np.sqrt((drawn * offset**2).sum() / drawn.sum())
        # each pixel gathers along its own radius, which turns within the kernel
        assert measured == pytest.approx(width_px, rel=0.06)
    assert drawn.sum() == pytest.approx(1.0, abs=0.05)


def test_point_spread_is_linear_between_rows_and_constant_beyond():
    rows = ((10.0, 1.3, 1.5), (20.0, 2.3, 1.3))
    largest_px, table = PointSpread(rows).table
    assert largest_px == 20.0
    radii = np.linspace(0.0, 20.0, table.shape[1])
    for axis in (0, 1):
        expected = np.interp(radii, (10.0, 20.0), [row[1 + axis] for row in rows])
        np.testing.assert_allclose(table[:, :, axis], np.tile(expected, (len(table), 1)), rtol=1e-6)
    image = random_image()
    np.testing.assert_allclose(PointSpread(((0.0, 0.0, 0.0),)).apply(image, GEOMETRY), image)
    spread, color = PointSpread(((10.0, 1.0, 0.5),)), ChromaticAberration(1.01, 1.0, (1.0, 2.0))
    assert spread.scaled(2.0).widths_px == ((20.0, 2.0, 1.0),)
    assert color.scaled(2.0) == ChromaticAberration(1.01, 1.0, (2.0, 4.0))


def test_narrow_point_spread_blurs_an_edge_as_the_formula_does():
    """Frequency transfer of the samples, at the half modulation with the square pixel, 0.5 %."""
    offset = np.stack(np.meshgrid(np.arange(-5, 6), np.arange(-5, 6)), axis=-1)
    for width_px, half in ((0.3, 0.4424), (0.5, 0.3231), (0.8, 0.2201)):
        for angle in (0.0, 0.3, np.pi / 4.0):
            ((along_px, across_px),) = sampled_widths_px(np.array(((width_px, width_px),)), angle)
            axis = np.array((np.cos(angle), np.sin(angle)))
            along, across = offset @ axis, offset @ (-axis[1], axis[0])
            weights = np.exp(-0.5 * ((along / along_px) ** 2 + (across / across_px) ** 2))
            transfer = (weights * np.cos(2.0 * np.pi * half * along)).sum() / weights.sum()
            expected = np.exp(-2.0 * (np.pi * width_px * half) ** 2)
            assert transfer == pytest.approx(expected, rel=0.005)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ((), "widths_px"),
        (((0.0, 9.0, 1.0),), r"widths_px\.0\.1"),
        (((0.0, -1.0, 1.0),), r"widths_px\.0\.1"),
        (((5.0, 1.0, 1.0), (5.0, 1.0, 1.0)), "widths_px: expected rows in order of their radii"),
    ],
)
def test_other_point_spreads_are_refused(rows, message):
    with pytest.raises(OpticsError, match=message):
        PointSpread(rows)


@pytest.mark.parametrize("blur", [Defocus(6.0, 6.0), PointSpread(((0.0, 3.0, 2.0),))])
def test_blur_ignores_invalid_pixels(context, blur):
    image = random_image()
    image[image[..., 3] > 0.5, :3] = 0.7
    drawn = on_gpu(context, [image], optics=blur.steps(GEOMETRY))
    np.testing.assert_allclose(drawn[image[..., 3] > 0.5, :3], 0.7, rtol=1e-5)


def test_offsets_of_red_and_blue_are_polynomials(context):
    """A smooth image along a row, shifted by the formula at the radius where the color lies."""
    u = np.arange(64.0)
    image = _dark()
    image[..., :3] = (0.5 + 0.4 * np.sin(u / 9.0))[None, :, None]
    color = ChromaticAberration(red_offsets_px=(0.5, 0.0, 1.0), blue_offsets_px=(0.0, -1.5))
    drawn = on_gpu(context, [image], optics=color.steps(SQUARE))[31]
    offset = u - 31.5
    radius = np.hypot(offset, 0.5) / 32.0
    for channel, moved_px in ((0, 0.5 * radius + radius**3), (1, 0.0 * u), (2, -1.5 * radius**2)):
        at = u - moved_px * offset / (32.0 * radius)
        expected = 0.5 + 0.4 * np.sin(at / 9.0)
        # at the border, samples lie outside; between pixels, a line stands for the sine
        np.testing.assert_allclose(drawn[2:-2, channel], expected[2:-2], atol=1e-3)


def test_red_and_blue_are_scaled(context):
    """A point at radius r goes to r · scale, found by its center of mass."""
    image = _dark()
    image[32, 52, :3] = 1.0  # 20.5 px right of the axis
    drawn = on_gpu(context, [image], optics=ChromaticAberration(1.02, 0.99).steps(SQUARE))
    u = np.arange(64)
    centers = [(drawn[..., c].sum(axis=0) * u).sum() / drawn[..., c].sum() for c in range(3)]
    # bilinear weights: the center of mass is right to the second order of the scale's change
    assert centers[0] - 31.5 == pytest.approx(20.5 * 1.02, abs=0.02)
    assert centers[1] == 52.0
    assert centers[2] - 31.5 == pytest.approx(20.5 * 0.99, abs=0.02)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_malvars_demosaicking_shifts_no_color(context, pattern):
    """A plane of light comes back as it was in every color: no half pixel, no wrong pattern.

    Its corrections want the colors' slopes alike.
    """
    v, u = np.mgrid[:64, :64]
    image = _dark()
    image[..., :3] = (0.2 + 0.004 * u + 0.002 * v)[..., None] + np.array([0.1, 0.0, 0.05])
    drawn = on_gpu(context, [image], sensor=Bayer(pattern, "malvar").steps(SQUARE))
    inner = np.s_[2:-2, 2:-2, :3]
    np.testing.assert_allclose(drawn[inner], image[inner], atol=1e-6)


def test_gray_gains_restore_white(context):
    balance = WhiteBalance((0.5, 1.0, 0.7))
    image = _dark()
    image[..., :3] = np.array(balance.response, dtype=np.float32) * 0.6
    drawn = on_gpu(context, [image], sensor=balance.steps(SQUARE))
    np.testing.assert_allclose(drawn[..., :3], 0.6, rtol=1e-6)
    assert WhiteBalance((0.5, 1.0, 0.7), (1.0, 1.0, 1.0)).factors == (1.0, 1.0, 1.0)


def test_dirt_depends_on_its_seed_and_scales():
    dirt = Dirt(dust_count=80, scratch_count=4, scratch_length_px=60.0)
    one, same = dirt.map(SQUARE), dirt.map(SQUARE)
    np.testing.assert_array_equal(one, same)
    other = Dirt(dust_count=80, scratch_count=4, scratch_length_px=60.0, seed=1).map(SQUARE)
    assert np.corrcoef(one[..., 0].ravel(), other[..., 0].ravel())[0, 1] < 0.2
    large = dirt.scaled(4.0).map(ImageGeometry(256, 256, (127.5, 127.5)))
    small = large.reshape(64, 4, 64, 4, 2).mean(axis=(1, 3))
    assert np.corrcoef(one[..., 0].ravel(), small[..., 0].ravel())[0, 1] > 0.9
    assert 0.0 <= large.min() <= large[..., 0].max() <= 1.0
    assert not Dirt(dust_count=0).map(SQUARE).any()


def test_dust_covers_the_expected_area():
    """Area of one speck: π r² e^(2σ²), but for its lumps; opacity 0.7 of the largest on average."""
    geometry = ImageGeometry(600, 600, (299.5, 299.5))
    dirt = Dirt(dust_count=1000, dust_radius_px=2.0, dust_opacity=0.1)
    taken = dirt.map(geometry)[..., 0].sum()
    lumps = 1.0 + 0.5 * (0.22**2 + 0.12**2 + 0.07**2)
    wanted = 1000 * np.pi * 4.0 * np.exp(2 * 0.25) * lumps * 0.07
    # soft edges add a few hundredths; areas scatter by 1.3 of their mean
    assert taken == pytest.approx(wanted, rel=0.05 + 4.0 * 1.35 / np.sqrt(1000))


def test_jpeg_loses_more_at_low_quality_and_keeps_the_mask():
    height, width = GEOMETRY.height_px, GEOMETRY.width_px
    v, u = np.mgrid[:height, :width]
    rgba = np.zeros((height, width, 4), dtype=np.uint8)
    rgba[..., :3] = (128 + 100 * np.sin(u / 3.0) * np.cos(v / 5.0))[..., None]
    rgba[..., 3] = 255 * (GEOMETRY.squared_radii() < 0.9)
    rgba[rgba[..., 3] == 0] = 0
    errors = []
    for quality in (100, 80, 40, 10):
        out = Jpeg(quality).compressed(rgba)
        np.testing.assert_array_equal(out[..., 3], rgba[..., 3])
        assert not out[rgba[..., 3] == 0].any()
        np.testing.assert_array_equal(out, Jpeg(quality).compressed(rgba))
        errors.append(np.abs(out.astype(int) - rgba).mean())
    assert errors == sorted(errors)
    assert errors[0] < 1.0 < errors[-1]


@pytest.mark.parametrize("pattern", PATTERNS)
def test_bilinear_demosaicking_matches_opencv(context, pattern):
    """OpenCV names a pattern by its second row's second and third pixel."""
    cv2 = pytest.importorskip("cv2")
    code = {"RGGB": "BG", "BGGR": "RG", "GRBG": "GB", "GBRG": "GR"}[pattern]
    raw = np.random.default_rng(5).integers(0, 65536, (64, 64), dtype=np.uint16)
    expected = cv2.cvtColor(raw, getattr(cv2, f"COLOR_Bayer{code}2RGB"))
    image = _dark()
    image[..., :3] = raw[..., None] / np.float32(65536.0)
    drawn = on_gpu(context, [image], sensor=Bayer(pattern, "bilinear").steps(SQUARE))
    # OpenCV rounds to whole steps of 2⁻¹⁶, and repeats its outermost pixels
    inner = np.s_[1:-1, 1:-1]
    assert np.abs(drawn[inner][..., :3] * 65536.0 - expected[inner]).max() <= 1.0
