"""Skies of scenes' TOMLs: clear ones and maps."""

import numpy as np
import OpenImageIO as oiio
import pytest

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from omnisim.scene.light.environment import Environment, map_directions
from omnisim.scene.light.lighting import DEFAULT_LIGHTING
from omnisim.scene.light.sky import clear_sky, sun_illuminance

UP = np.array([[0.0, 0.0, 1.0]])


def _load(folder, sky, extends="rings"):
    path = folder / "scene.toml"
    path.write_text(f'extends = "{extends}"\n[sky]\n{sky}\n')
    return load_scene(path)


def _write(path, pixels):
    height, width, channels = pixels.shape
    out = oiio.ImageOutput.create(str(path))
    out.open(str(path), oiio.ImageSpec(width, height, channels, "float"))
    out.write_image(pixels.astype(np.float32))
    out.close()


def test_a_sky_over_any_scene_is_that_of_a_toml(tmp_path):
    map_file, mesh, dull = tmp_path / "map.exr", tmp_path / "a.obj", tmp_path / "dull.toml"
    _write(map_file, np.random.default_rng(1).uniform(0.0, 2.0, (16, 32, 3)))
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    dull.write_text('extends = "rings"\n[sky]\nturbidity = 9.0\n')  # another sky
    for sky, table in (("clear", ""), (map_file, 'file = "map.exr"')):
        expected = _load(tmp_path, table).lighting
        for source in ("rings", dull):
            _assert_same_light(load_scene(source, sky=sky).lighting, expected)
        under = load_scene(mesh, sky=sky).lighting
        assert under.ambient == (0.0, 0.0, 0.0)
        assert under.environment is not None


NOON = "[sun]\ntime = 2026-06-21T10:00:00Z\nlatitude_deg = 48.0\nlongitude_deg = 11.0\n"
EVENING = NOON.replace("T10", "T17")
LAMP = '[[lamps]]\nkind = "point"\nposition_m = [0, 0, 2]\nintensity = 500.0\n'


def _chain(folder, base, child):
    """Lighting of a scene that extends one that extends a built-in one."""
    (folder / "base.toml").write_text(f'extends = "rings"\n{base}')
    path = folder / "child.toml"
    path.write_text(f'extends = "base.toml"\n{child}')
    return path


def _assert_same_light(found, expected):
    assert (found.exposure, found.ambient) == (expected.exposure, expected.ambient)
    lights = [
        [(light.intensity, *light.direction) for light in each.lights] for each in (found, expected)
    ]
    assert lights[0] == lights[1]
    radiances = [each.environment and each.environment.radiance for each in (found, expected)]
    np.testing.assert_array_equal(*radiances)


def test_the_courtyard_is_lit_by_the_sun_at_its_clock_s_time_and_evenly_without_it():
    lit, even = load_scene("courtyard").lighting, load_scene("courtyard", sky="none").lighting
    (sun,) = lit.lights
    assert sun.casts_shadow
    assert lit.environment is not None
    assert -sun.direction[2] == pytest.approx(np.sin(np.radians(31.5)), abs=0.01)
    assert 50_000.0 < sun.intensity < 100_000.0
    assert even.lights is DEFAULT_LIGHTING.lights
    _assert_same_light(even, DEFAULT_LIGHTING)


@pytest.mark.parametrize("own", [EVENING, "[sky]\nturbidity = 4.0\n", f"{EVENING}[sky]\n"])
def test_a_sun_or_sky_takes_the_place_of_those_of_the_base(tmp_path, own):
    found = load_scene(_chain(tmp_path, f"{NOON}[sky]\n", own)).lighting
    _assert_same_light(found, load_scene(_chain(tmp_path, "", own)).lighting)


def test_a_scene_may_be_without_the_sky_and_the_sun_of_its_base(tmp_path):
    even = load_scene("rings").lighting
    for base in (f"{NOON}[sky]\n", NOON, "[sky]\n"):
        found = load_scene(_chain(tmp_path, base, '[light]\nsky = "none"\n')).lighting
        path = _chain(tmp_path, base, "")
        for one in (found, load_scene(path, sky="none").lighting):
            assert one.lights is DEFAULT_LIGHTING.lights
            _assert_same_light(one, even)
        assert load_scene(path).lighting.lights[0].intensity > 1000.0  # lux
    lit = load_scene(_chain(tmp_path, f"{NOON}[sky]\n", f'{LAMP}[light]\nsky = "none"\n')).lighting
    _assert_same_light(lit, load_scene(_chain(tmp_path, "", LAMP)).lighting)


@pytest.mark.parametrize("base", [f"{NOON}[sky]\n", "[sky]\n"])
def test_lamps_shine_beside_the_sky_of_the_base_at_its_exposure(tmp_path, base):
    before = load_scene(_chain(tmp_path, base, "")).lighting
    lit = load_scene(_chain(tmp_path, base, LAMP)).lighting
    assert [light.kind.value for light in lit.lights] == ["directional", "point"]
    assert lit.exposure == before.exposure
    np.testing.assert_array_equal(lit.environment.radiance, before.environment.radiance)


def test_an_exposure_is_that_of_the_base_s_sky_too(tmp_path):
    before = load_scene(_chain(tmp_path, f"{NOON}[sky]\n", "")).lighting
    bright = f"[light]\nexposure = {2.0 * before.exposure}\n"
    found = load_scene(_chain(tmp_path, f"{NOON}[sky]\n", bright)).lighting
    assert found.exposure == 2.0 * before.exposure
    np.testing.assert_allclose(found.environment.radiance, 2.0 * before.environment.radiance)
    assert found.lights[0].intensity == before.lights[0].intensity


def test_a_sky_of_the_option_takes_the_place_of_all(tmp_path):
    map_file = tmp_path / "map.exr"
    _write(map_file, np.full((16, 32, 3), 0.5))
    for base in (f"{NOON}[sky]\nturbidity = 5.0\n", NOON):
        path = _chain(tmp_path, base, "[fog]\ncolor = [0, 0, 0]\nvisibility_m = 9.0\n")
        found = load_scene(path, sky="clear").lighting  # around the sun of the base
        expected = _chain(tmp_path, f"{NOON}[sky]\n", "")
        _assert_same_light(found, load_scene(expected).lighting)
        (tmp_path / "base.toml").write_text(f'extends = "rings"\n{base}')
        assert load_scene(path, sky=map_file).lighting.lights == ()


def _towards(elevation_deg):
    angle = np.radians(elevation_deg)
    return np.array([np.cos(angle), 0.0, np.sin(angle)])


def test_a_clear_sky_is_blue_brightest_near_the_sun_and_as_bright_as_skies_are():
    """A clear sky gives level ground some 10 to 20 klx; the model is known to give more."""
    sky = clear_sky(_towards(50.0), 3.0)
    assert sky.shape == (256, 512, 3)
    assert np.isfinite(sky).all()
    assert sky.min() >= 0.0
    level = np.pi * Environment(sky).ambient(UP)[0] @ (0.2126, 0.7152, 0.0722)
    assert 10_000.0 < level < 35_000.0
    zenith = sky[0].mean(axis=0)
    assert zenith[2] > 1.5 * zenith[0]
    row, column = np.unravel_index(sky[:128].sum(axis=2).argmax(), (128, 512))
    assert abs(row - 256 * 40 / 180) < 4
    assert abs(column - 255.5) < 3


def test_the_sun_is_as_bright_as_the_sun_and_redder_when_low():
    """Direct sun of a clear day: some 80 to 105 klx at 60° (IES handbook)."""
    high, low = (sun_illuminance(_towards(angle), 3.0) for angle in (60.0, 5.0))
    assert 70_000.0 < high @ (0.2126, 0.7152, 0.0722) < 110_000.0
    assert low[2] / low[0] < 0.7 * high[2] / high[0]
    assert low.sum() < 0.5 * high.sum()


@pytest.mark.parametrize("elevation_deg", [10.0, 45.0, 90.0])
def test_a_level_surface_is_as_bright_as_asked(tmp_path, elevation_deg):
    lighting = _load(tmp_path, f"brightness = 0.7\nsun_elevation_deg = {elevation_deg}").lighting
    (sun,) = lighting.lights
    level = lighting.environment.ambient(UP)[0]
    level += np.array(sun.color) * (sun.intensity * lighting.exposure * -sun.direction[2])
    assert level @ (0.2126, 0.7152, 0.0722) == pytest.approx(0.7, rel=1e-3)
    assert -sun.direction[2] == pytest.approx(np.sin(np.radians(elevation_deg)))
    assert lighting.ambient == (0.0, 0.0, 0.0)


def test_a_clear_sky_stands_around_the_sun_of_its_table(tmp_path):
    lighting = _load(tmp_path, f"brightness = 0.9\n{NOON}").lighting
    (sun,) = lighting.lights
    pixels = lighting.environment.radiance
    row, column = np.unravel_index(pixels[:128].sum(axis=2).argmax(), (128, 512))
    directions, _ = map_directions(*pixels.shape[:2])
    assert directions[row, column] @ -sun.direction > 0.99
    level = lighting.environment.ambient(UP)[0]
    level += np.array(sun.color) * (sun.intensity * lighting.exposure * -sun.direction[2])
    assert level @ (0.2126, 0.7152, 0.0722) == pytest.approx(0.9, rel=1e-3)
    assert sun.intensity > 50_000.0


def test_a_clear_sky_by_night_is_refused(tmp_path):
    with pytest.raises(SceneError, match="sky: expected a sun above the horizon"):
        _load(tmp_path, NOON.replace("10:00", "23:00"))


@pytest.mark.parametrize("suffix", ["hdr", "exr"])
def test_a_map_is_turned_and_scaled(tmp_path, suffix):
    pixels = np.full((16, 32, 3), 0.5)
    pixels[7:9, 15:17] = (40.0, 0.0, 0.0)
    _write(tmp_path / f"sky.{suffix}", pixels)
    lighting = _load(tmp_path, f'file = "sky.{suffix}"\nyaw_deg = 90').lighting
    assert lighting.lights == ()
    level = lighting.environment.ambient(UP)[0] @ (0.2126, 0.7152, 0.0722)
    assert level == pytest.approx(0.8, rel=1e-3)
    red, gray = lighting.environment.seen(np.array([[0.0, 1, 0], [1, 0, 0]]))
    assert red[0] > 50.0 * gray[0]


@pytest.mark.parametrize(
    ("sky", "expected"),
    [
        ('file = "none.hdr"', "sky.file = 'none.hdr': no such file beside it"),
        ('file = "scene.toml"', r"expected an environment map \(.hdr, .exr\), got '.toml'"),
        ('file = "bad.exr"', "bad.exr: cannot be read"),
        ('file = "square.exr"', "expected a map twice as wide as high"),
        ('file = "dark.exr"', "expected finite radiance of at least 0"),
        ('file = "x.hdr"\nturbidity = 3', "expected a clear sky"),
        ("yaw_deg = 3", "yaw_deg: requires file, an environment map"),
        ("turbidity = 1", "sky.turbidity: expected a number ≥ 2, got 1"),
        ("sun_elevation_deg = -5", "sky.sun_elevation_deg: expected a number > 0, got -5"),
        ("brightness = 0", "sky.brightness: expected a number .*, got 0"),
        ('[light]\nsky = "clear"', "light.sky: expected 'none', got 'clear'"),
        ('[light]\nsky = "none"', "light.sky: expected no sun and no sky with it"),
    ],
)
def test_a_bad_sky_is_one_line(tmp_path, sky, expected):
    (tmp_path / "bad.exr").write_bytes(b"no image")
    _write(tmp_path / "square.exr", np.ones((8, 8, 3)))
    _write(tmp_path / "dark.exr", np.full((8, 16, 3), -1.0))
    with pytest.raises(SceneError, match=expected) as caught:
        _load(tmp_path, sky)
    assert "\n" not in str(caught.value)
