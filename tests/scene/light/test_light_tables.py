"""Light of a scene by its TOML: lamps, sun, fog, shadows, exposure."""

import math

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from omnisim.scene.light.lighting import DEFAULT_LIGHTING, FILL_AMBIENT, light_summary
from omnisim.scene.model import LightKind


def _scene(tmp_path, text):
    path = tmp_path / "lit.toml"
    path.write_text(f'extends = "rings"\n{text}', encoding="utf-8")
    return load_scene(path)


SUN = "[sun]\ntime = {}\nlatitude_deg = 52.4\nlongitude_deg = 4.9\n"
NOON = SUN.format("2026-06-21T12:00:00+02:00")
TWO_LAMPS = """
[[lamps]]
kind = "point"
position_m = [0.0, 1.0, 3.0]
intensity = 800.0
[[lamps]]
kind = "spot"
position_m = [0.0, 1.0, 3.0]
direction = [0.0, 0.0, -2.0]
outer_deg = 60.0
intensity = 500.0
color = [1.0, 0.5, 0.0]
shadows = false
"""


def test_even_light_casts_no_shadows(tmp_path):
    plain = _scene(tmp_path, "").lighting
    assert plain.lights is DEFAULT_LIGHTING.lights
    assert not plain.has_shadows
    assert not _scene(tmp_path, "[light]\nshadows = true\n").lighting.has_shadows


def test_lamps_take_the_place_of_even_light(tmp_path):
    point, spot = _scene(tmp_path, TWO_LAMPS).lighting.lights
    assert (point.kind, spot.kind) == (LightKind.POINT, LightKind.SPOT)
    assert (point.casts_shadow, spot.casts_shadow) == (True, False)
    np.testing.assert_allclose(spot.direction, (0.0, 0.0, -1.0))
    np.testing.assert_allclose(spot.cone_cosines, (1.0, 0.5))


def test_black_ambient_light_disables_even_light(tmp_path):
    dark = _scene(tmp_path, "[light]\nambient = [0, 0, 0]\n")
    assert (dark.lighting.ambient, dark.lighting.lights) == ((0.0, 0.0, 0.0), ())
    assert light_summary(dark.lighting) == "none: only emission"
    dim = _scene(tmp_path, "[light]\nambient = [0, 0, 0.1]\n")
    assert len(dim.lighting.lights) == 2


def test_shadows_ambient_and_exposure_are_chosen(tmp_path):
    text = "[light]\nshadows = false\nambient = [0.1, 0.2, 0.3]\nexposure = 0.01\n"
    lighting = _scene(tmp_path, TWO_LAMPS + text).lighting
    assert not lighting.has_shadows
    assert (lighting.ambient, lighting.exposure) == ((0.1, 0.2, 0.3), 0.01)
    assert len(lighting.lights) == 2


def test_the_sun_shines_by_day(tmp_path):
    (sun,) = _scene(tmp_path, NOON).lighting.lights
    assert sun.kind is LightKind.DIRECTIONAL
    assert sun.casts_shadow
    assert math.degrees(math.asin(-sun.direction[2])) == pytest.approx(55.1, abs=0.1)
    assert sun.direction[0] < 0.0 < sun.direction[1]  # it is in the south-east
    night = _scene(tmp_path, SUN.format("2026-06-21T00:00:00+02:00")).lighting
    assert night.lights == ()
    assert night.ambient == FILL_AMBIENT


def test_fog_is_thin_by_its_visibility(tmp_path):
    fog = _scene(tmp_path, "[fog]\ncolor = [0.5, 0.6, 0.7]\nvisibility_m = 20.0\n").lighting.fog
    assert math.exp(-20.0 * fog.attenuation_per_m[1]) == pytest.approx(0.05)
    water = _scene(tmp_path, "[fog]\ncolor = [0, 0, 1]\nattenuation_per_m = [0.4, 0.07, 0.03]\n")
    assert water.lighting.fog.attenuation_per_m == (0.4, 0.07, 0.03)
    assert water.lighting.lights is DEFAULT_LIGHTING.lights


ONE_LAMP = "[[lamps]]\nintensity = 1.0\n"
FAULTS = {
    "point without position": (ONE_LAMP + 'kind = "point"', "position_m: missing"),
    "sun without offset": (SUN.format("2026-06-21T12:00:00"), "offset from UTC"),
    "sun at a text": (SUN.format('"noon"'), "expected a time as 2026"),
    "no direction":
        (ONE_LAMP + 'kind = "directional"\ndirection = [0, 0, 0]', "length other than 0"),
    "inner beyond outer":
        (TWO_LAMPS + "inner_deg = 60.0", "less than outer_deg"),
    "two measures of fog":
        ("[fog]\ncolor = [1, 1, 1]\nvisibility_m = 1.0\nattenuation_per_m = [1, 1, 1]",
         "either visibility_m or attenuation_per_m"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), FAULTS.values(), ids=FAULTS.keys())
def test_faults_are_named(tmp_path, text, message):
    with pytest.raises(SceneError, match=message) as caught:
        _scene(tmp_path, text)
    assert "lit.toml" in str(caught.value)
    assert "\n" not in str(caught.value)
