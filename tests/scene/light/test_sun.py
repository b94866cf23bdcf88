"""Positions of the sun, against published ones."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from omnisim.scene.light.sky import sun_illuminance_lx, sun_position


def test_the_example_of_the_solar_position_algorithm():
    """Reda and Andreas, "Solar Position Algorithm for Solar Radiation Applications", NREL, 2008,
    table A5.1: topocentric elevation without refraction, and azimuth."""
    time = datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7)))
    elevation_deg, azimuth_deg = sun_position(time, 39.742476, -105.1786)
    assert elevation_deg == pytest.approx(39.872046, abs=0.01)
    assert azimuth_deg == pytest.approx(194.340241, abs=0.01)


# Times of the United States Naval Observatory, to a minute.
SEASONS = {
    "March equinox": (datetime(2024, 3, 20, 3, 6, tzinfo=UTC), 0.0),
    "June solstice": (datetime(2024, 6, 20, 20, 51, tzinfo=UTC), 23.436),
    "September equinox": (datetime(2024, 9, 22, 12, 44, tzinfo=UTC), 0.0),
    "December solstice": (datetime(2024, 12, 21, 9, 21, tzinfo=UTC), -23.436),
}


@pytest.mark.parametrize(("time", "declination_deg"), SEASONS.values(), ids=SEASONS.keys())
def test_declination_at_the_beginning_of_the_seasons(time, declination_deg):
    # seen from the pole it is as high as its declination
    assert sun_position(time, 90.0, 0.0).elevation_deg == pytest.approx(declination_deg, abs=0.01)


def test_light_comes_from_where_the_sun_is():
    noon = datetime(2024, 3, 20, 12, 7, tzinfo=UTC)  # later by the equation of time
    high = sun_position(noon, 45.0, 0.0)
    assert high.azimuth_deg == pytest.approx(180.0, abs=0.3)
    np.testing.assert_allclose(
        high.direction(north_deg=90.0), (0.0, np.sqrt(0.5), -np.sqrt(0.5)), atol=5e-3
    )
    np.testing.assert_allclose(
        high.direction(north_deg=0.0), (np.sqrt(0.5), 0.0, -np.sqrt(0.5)), atol=5e-3
    )
    morning = sun_position(noon - timedelta(hours=4), 45.0, 0.0)
    assert 90.0 < morning.azimuth_deg < 180.0
    assert sun_position(noon + timedelta(hours=12), 45.0, 0.0).elevation_deg < 0.0


def test_the_sun_is_strongest_above():
    levels = [sun_illuminance_lx(elevation_deg) for elevation_deg in (-5.0, 0.5, 10.0, 45.0, 90.0)]
    assert levels[0] == 0.0
    assert levels == sorted(levels)
    assert 90_000.0 < levels[-1] < 110_000.0
