"""Environment maps against integrals over the sphere, and their axes."""

import numpy as np
import pytest

from omnisim.scene.light import environment
from omnisim.scene.light.environment import Environment, lookup, map_directions
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS, TABLE_SIZE, environment_table


@pytest.fixture(autouse=True)
def _small_maps(monkeypatch):
    monkeypatch.setattr(environment, "FILTERED_ROWS", 128)


def _sphere(count=10_000):
    """Directions spread evenly over the sphere (Fibonacci)."""
    height = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    azimuth = np.pi * (1.0 + 5.0**0.5) * np.arange(count)
    side = np.sqrt(1.0 - height**2)
    return np.stack((side * np.cos(azimuth), side * np.sin(azimuth), height), axis=-1)


def _smooth(directions):
    """Colors of order 2 at most, for which nine harmonics are exact."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack((1.0 + 0.5 * x + 0.3 * x * y, 1.0 - 0.4 * z + 0.2 * z * z, 0.8 + y), axis=-1)


def test_light_on_matte_surfaces_is_the_integral_over_the_hemisphere():
    directions, _ = map_directions(128, 256)
    sky = Environment(_smooth(directions).astype(np.float32))
    around = _sphere()
    normals = _sphere(30)
    cosines = np.maximum(normals @ around.T, 0.0)
    expected = 4.0 / len(around) * cosines @ _smooth(around)
    assert sky.ambient(normals) == pytest.approx(expected, abs=2e-3)


def test_an_even_environment_is_the_same_at_all_roughnesses():
    sky = Environment(np.full((64, 128, 3), 0.7, np.float32))
    normals = _sphere(50)
    assert sky.ambient(normals) == pytest.approx(0.7, rel=1e-4)
    for roughness in (0.0, 0.13, 0.5, 1.0):
        light = sky.light(normals, np.full(50, roughness))
        assert light == pytest.approx(0.7, rel=1e-4)


def test_filtered_maps_are_lobes_of_ggx():
    """A surface seen along its normal: half vectors by the distribution, over all directions."""
    directions, _ = map_directions(128, 256)
    spot = np.array([0.6, 0.0, 0.8])
    colors = np.repeat(np.exp(40.0 * (directions @ spot - 1.0))[..., None], 3, axis=-1)
    sky = Environment(colors.astype(np.float32))
    around = _sphere()
    radiance = np.exp(40.0 * (around @ spot - 1.0))
    for roughness in (0.4, 0.6, 1.0):
        for normal in (spot, np.array([0.0, 0.0, 1.0])):
            cosines = around @ normal
            half = np.sqrt(np.clip(0.5 * (1.0 + cosines), 1e-9, 1.0))
            squared = roughness**4
            weights = squared / (half**2 * (squared - 1.0) + 1.0) ** 2 * np.maximum(cosines, 0.0)
            expected = (weights * radiance).sum() / weights.sum()
            found = sky.light(normal[None], np.array([roughness]))[0, 0]
            assert found == pytest.approx(expected, rel=0.06, abs=0.02)  # of 1 at the spot


def test_the_middle_is_x_and_left_of_it_is_y():
    pixels = np.zeros((16, 32, 3), np.float32)
    pixels[7:9, 15:17] = (1, 0, 0)
    pixels[7:9, 7:9] = (0, 1, 0)
    pixels[0] = (0, 0, 1)
    seen = Environment(pixels).seen(np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]))
    assert seen == pytest.approx(np.eye(3), abs=1e-6)


def test_the_map_has_no_seam():
    directions, _ = map_directions(64, 128)
    sky = Environment(_smooth(directions).astype(np.float32))
    angles = np.radians([179.9, -179.9])
    behind = np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=-1)
    one, other = sky.seen(behind, np.full(2, 0.02))
    assert one == pytest.approx(other, abs=0.01)


def test_shares_of_an_even_environment_are_integrals_of_the_reflectance():
    """The table against GGX, Smith and Schlick, summed over all directions of light."""
    table = environment_table()
    around = _sphere(100_000)
    around = around[around[:, 2] > 0.0]
    solid_angle = 2.0 * np.pi / len(around)
    for roughness, cosine in ((0.3, 0.9), (0.5, 0.5), (1.0, 0.2), (0.7, 1.0)):
        view = np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])
        half = around + view
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        light, squared = around[:, 2], roughness**4
        distribution = squared / np.pi / (half[:, 2] ** 2 * (squared - 1.0) + 1.0) ** 2
        smith = light * np.sqrt(cosine**2 * (1.0 - squared) + squared)
        smith += cosine * np.sqrt(light**2 * (1.0 - squared) + squared)
        lobe = distribution * 0.5 / smith * light * solid_angle
        grazing = (1.0 - half @ view) ** 5
        expected = (
            (lobe * (1.0 - grazing)).sum(), (lobe * grazing).sum(),
            (light * grazing).sum() * solid_angle / np.pi,
        )  # fmt: skip
        place = np.array([[
            (cosine * (TABLE_SIZE[0] - 1) + 0.5) / TABLE_SIZE[0],
            (max(roughness, MIN_ROUGHNESS) * (TABLE_SIZE[1] - 1) + 0.5) / TABLE_SIZE[1],
        ]])  # fmt: skip
        assert lookup(table, place)[0] == pytest.approx(expected, abs=4e-3)
