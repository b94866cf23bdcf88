"""Fits from one camera model to another, their residuals computed again by other formulas."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.cameras import CAMERA_MODELS, HyperbolicCamera, PerspectiveCamera, pixel_grid
from omnisim.cameras.calibration.fit import FITTED_MODELS, fit_camera, mirrored_frame, samples_of
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.models.field_of_view import largest_theta_rad, optical_axis
from omnisim.core.errors import CalibrationError
from tests.camera_examples import CAMERA_EXAMPLES
from tests.cameras import formulas

EXACT_PAIRS = [
    *((name, model) for name in ("hyperbolic-paper", "hyperbolic-up-face", "parabolic-off-center",
                                 "stereographic", "perspective-wide", "unified-no-distortion",
                                 "planar", "elliptic-off-center")
      for model in ("unified", "eucm", "double_sphere")),
    ("orthographic-full", "eucm"),
    ("orthographic-full", "gazebo"),
    ("parabolic", "ocamcalib"),
    ("planar", "ocamcalib"),
    ("planar", "perspective"),
    ("stereographic", "gazebo"),
    ("equisolid-full-sphere", "gazebo"),
    ("gazebo-id", "equidistant"),
    ("equidistant-full-sphere", "kannala_brandt"),
    ("equidistant-off-center", "f_theta"),
    ("equidistant-off-center", "f_theta_inverse"),
    ("f-theta-to-its-fold", "kannala_brandt"),
    ("unified-kitti-360", "unified"),
    ("double-sphere-tum-vi", "double_sphere"),
]  # fmt: skip


def _fit(name, model, **options):
    camera = CAMERA_EXAMPLES[name]
    return fit_camera(camera, CAMERA_MODELS[model], mirrored=optical_axis(camera) < 0.0, **options)


@pytest.mark.parametrize(("name", "model"), EXACT_PAIRS)
def test_equivalent_models_are_fitted_exactly(name, model):
    fit = _fit(name, model)
    assert fit.covered == 1.0
    assert fit.residuals.max_px <= 1e-9


def test_unified_of_a_mirror_is_geyers_closed_form():
    camera = CAMERA_EXAMPLES["hyperbolic-paper"]
    fit = _fit("hyperbolic-paper", "unified")
    assert fit.camera.xi == pytest.approx(camera.mirror.xi, rel=1e-12)
    assert fit.camera.focal_lengths_px == pytest.approx(
        [camera.unified_focal_length_px] * 2, rel=1e-12
    )


def test_mirrored_frame_maps_rays_of_the_source_to_the_fit():
    for name in ("hyperbolic-paper", "elliptic"):
        camera, fit = CAMERA_EXAMPLES[name], _fit(name, "unified")
        pixels = pixel_grid(camera.width_px, camera.height_px)[::40, ::40]
        source, fitted = camera.ray_from_pixel(pixels), fit.camera.ray_from_pixel(pixels)
        np.testing.assert_allclose(
            fitted.directions[source.valid],
            source.directions[source.valid] @ mirrored_frame(camera).T,
            atol=1e-12,
        )
        assert np.linalg.det(mirrored_frame(camera)) == -1.0  # a mirror's image is mirrored


@pytest.mark.parametrize(
    ("name", "model", "formula", "fixed", "most_px"),
    [
        ("double-sphere-tum-vi", "kannala_brandt", formulas.kannala_brandt, {}, 0.01),
        ("hyperbolic-paper", "kannala_brandt", formulas.kannala_brandt, {}, 0.01),
        ("equisolid-off-center", "eucm", formulas.eucm, {}, 0.5),
        ("kannala-brandt-tum-vi", "eucm", formulas.eucm, {}, 5.0),
        ("hyperbolic-nearly-plane", "unified", formulas.brown, {"xi": 0.0}, 0.5),
    ],
)
def test_residuals_are_those_of_the_formula(name, model, formula, fixed, most_px):
    """Over every pixel of the image, where the fit knows some of them."""
    source = CAMERA_EXAMPLES[name]
    fit = _fit(name, model, fixed=fixed)
    pixels = pixel_grid(source.width_px, source.height_px).reshape(-1, 2)
    rays = source.ray_from_pixel(pixels)
    directions = rays.directions[rays.valid] * (1.0, 1.0, optical_axis(source))
    # the formula knows no domain: only what the fit says that it sees
    sees = np.arccos(np.clip(directions[:, 2], -1.0, 1.0)) <= fit.residuals.theta_max_rad
    expected_px = formula(fit.camera, *directions[sees].T)
    off = np.linalg.norm(expected_px - pixels[rays.valid][sees], axis=-1)
    # a thousand samples know an RMS to some percent
    assert fit.residuals.rms_px == pytest.approx(math.sqrt(np.mean(off**2)), rel=0.1)
    assert off.max() <= 1.05 * fit.residuals.max_px
    assert fit.residuals.max_px < most_px


def test_fit_is_the_smallest_near_by():
    """No parameter of the fit can be moved without making it worse."""
    source = CAMERA_EXAMPLES["double-sphere-tum-vi"]
    samples = samples_of(source, mirrored=False)

    def cost(camera):
        seen = camera.pixel_from_ray(samples.directions)
        return np.sum((seen.positions_px - samples.pixels_px) ** 2)

    best = _fit("double-sphere-tum-vi", "eucm").camera
    for name in ("alpha", "beta"):
        for factor in (1.0 - 1e-4, 1.0 + 1e-4):
            other = dataclasses.replace(best, **{name: getattr(best, name) * factor})
            assert cost(other) > cost(best)


def test_fixed_parameters_stay():
    fit = _fit("perspective", "unified", fixed={"xi": 0.0, "distortion": (0.0, 0.0, 0.0, 0.0)})
    assert (fit.camera.xi, fit.camera.distortion) == (0.0, (0.0,) * 4)
    assert fit.residuals.max_px <= 1e-9


def test_covered_share_leaves_out_pixels_beyond_the_target():
    # a half sphere of a whole one: r = f θ up to 90° is a quarter of the disc
    source = CAMERA_EXAMPLES["equidistant-full-sphere"]
    fit = fit_camera(source, CAMERA_MODELS["eucm"])
    assert 0.3 < fit.covered < 0.9
    assert fit.residuals.theta_max_rad < math.pi


def test_a_fit_ends_where_its_source_does():
    source = CAMERA_EXAMPLES["equisolid-off-center"]
    fit = fit_camera(source, CAMERA_MODELS["kannala_brandt"])
    assert fit.camera.theta_max_rad == pytest.approx(largest_theta_rad(source), abs=1e-6)


def test_a_mirror_has_to_be_mirrored():
    narrow = HyperbolicMirror(theta_max_rad=math.radians(60.0))
    with pytest.raises(CalibrationError, match="rays of a mirror need mirrored"):
        fit_camera(HyperbolicCamera.framed_on_rim(narrow, 360, 360), PerspectiveCamera)


@pytest.mark.parametrize("name", ["equirectangular", "cylindrical"])
def test_a_panorama_is_no_lens(name):
    with pytest.raises(CalibrationError, match=r"cannot be fitted by kannala_brandt: .* px RMS"):
        _fit(name, "kannala_brandt")


def test_a_model_without_a_fit_is_named():
    with pytest.raises(CalibrationError, match="by equirectangular: expected one of perspective, "):
        _fit("perspective", "equirectangular")


def test_lenses_can_be_targets():
    lenses = {
        "perspective", "equidistant", "stereographic", "equisolid", "orthographic",
        "kannala_brandt", "eucm", "double_sphere", "unified", "f_theta", "f_theta_inverse",
        "ocamcalib", "radial_table", "gazebo", "rational_polynomial",
    }  # fmt: skip
    assert lenses <= set(FITTED_MODELS)
