"""Catalog of measured cameras: names, search, lenses, and what is said about them."""

import numpy as np
import pytest

from omnisim.cameras import KannalaBrandtCamera
from omnisim.cameras.calibration import load_calibration
from omnisim.cameras.catalog import lens_catalog
from omnisim.cameras.catalog.lens_catalog import catalog, find, search
from omnisim.core.errors import CalibrationError
from omnisim.rendering.camera.omnicamera import OmniCamera

NAME = "gopro/hero11-black/wide-3840x2160"


def bisected(coefficients, radius):
    """Angles at radii, by bisection up to the first fold."""
    theta = np.linspace(0.0, np.pi, 20_001)

    def grown(angles):
        squared = angles * angles
        return angles * (1.0 + sum(k * squared**n for n, k in enumerate(coefficients, start=1)))

    falls = np.flatnonzero(np.diff(grown(theta)) <= 0.0)
    low, high = (
        np.zeros_like(radius),
        np.full_like(radius, theta[falls[0]] if len(falls) else np.pi),
    )
    reaches = grown(high) >= radius
    for _ in range(80):
        middle = 0.5 * (low + high)
        below = grown(middle) < radius
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return low, reaches


def test_every_entry_is_a_lens():
    entries = catalog()
    assert len(entries) > 9_000
    for entry in list(entries.values())[::20]:
        assert isinstance(entry.lens, KannalaBrandtCamera)
        assert entry.error_px >= 0.0
        assert entry.readout_s is None or 0.0 <= entry.readout_s < 1.0


@pytest.mark.slow
def test_lenses_agree_with_bisection():
    chosen = np.random.default_rng(4).choice(sorted(catalog()), 500, replace=False)
    for name in chosen:
        lens = find(str(name)).lens
        u, v = (np.linspace(0.0, side - 1.0, 9) for side in (lens.width_px, lens.height_px))
        pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        rays = lens.ray_from_pixel(pixels)
        radius = np.linalg.norm((pixels - lens.principal_point_px) / lens.focal_lengths_px, axis=1)
        theta, reaches = bisected(lens.coefficients, radius)
        ours = np.arctan2(np.hypot(*rays.directions[:, :2].T), rays.directions[:, 2])
        seen = rays.valid & reaches
        assert np.mean(rays.valid == reaches) > 0.98, name  # but for pixels at the fold
        # the slope at a fold is 0: there an angle says less than its radius
        again = lens.pixel_from_ray(rays.directions[seen]).positions_px
        assert np.abs(again - pixels[seen]).max(initial=0.0) < 1e-6, name
        assert np.median(np.abs(ours - theta)[seen]) < 1e-9, name


@pytest.mark.parametrize("words", ["hero 11 black wide 4k", "GoPro HERO11 wide 2160p", NAME])
def test_search_takes_makers_models_modes_and_sizes(words):
    assert NAME in [entry.name for entry in search(words)]


def test_search_ranks_what_was_said_before_what_begins_so():
    first = search("hero5 black 4k", limit=3)
    assert len(first) == 3
    assert first[0].fields.model == "HERO5 Black"
    assert "~" not in first[0].name


def test_a_camera_has_its_measured_rolling_shutter():
    measured = next(entry for entry in catalog().values() if entry.readout_s)
    camera = OmniCamera.of(f"catalog:{measured.name}")
    assert camera.degradation.shutter.readout_s == measured.readout_s
    assert camera.model == measured.lens
    assert OmniCamera.of(f"catalog:{NAME}").degradation.is_ideal


def test_a_calibration_of_the_catalog_has_its_notes():
    stretched = next(entry for entry in catalog().values() if entry.fields.stretch)
    calibration = load_calibration(f"catalog:{stretched.name}")
    assert calibration.cameras[0].camera == stretched.lens
    assert any("stretched by" in note for note in calibration.notes)
    assert find("hero11-black/wide-4k").name == NAME


def test_an_angle_ends_its_field_of_view_and_other_options_are_refused():
    lens = load_calibration(f"catalog:{NAME}", theta_max_deg=40.0).cameras[0].camera
    assert lens.domain_limit_rad == pytest.approx(np.radians(40.0))
    with pytest.raises(CalibrationError, match="format, mirrored: expected none"):
        load_calibration(f"catalog:{NAME}", format="kalibr")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("catalog:hero", "expected the name of one, such as gopro/hero.* and [0-9]+ more"),
        ("catalog:nomaker", 'no such camera: omnisim calibration search "maker model"'),
        ("catalog:", "no such camera"),
    ],
)
def test_names_of_none_or_of_several_are_refused(name, expected):
    with pytest.raises(CalibrationError, match=expected):
        load_calibration(name)


def test_the_catalog_is_small():
    path = lens_catalog.resources.files(lens_catalog.__package__).joinpath(lens_catalog.FILE)
    assert len(path.read_bytes()) <= 800_000
