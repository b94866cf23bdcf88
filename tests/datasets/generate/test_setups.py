"""Setups: light, sky and cameras that vary, as functions of seed and number."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from omnisim.apps.cli.app import app
from omnisim.core.errors import OmnisimError
from omnisim.core.srgb import linear_from_srgb8
from omnisim.datasets.generate.draw import draw_indices
from omnisim.datasets.generate.plan_cameras import black_body_rgb
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.sample_renderer import SampleRenderer, setup_light, setup_rig
from omnisim.datasets.generate.samples import Shards
from omnisim.scene.parts import LightKind
from tests.datasets.plans import write_plan

CAMERA = """parameters = { focal_length_px = [-20.0, 20.0], principal_point_px = [-5.0, 5.0] }
mount_turn_deg = { normal = [0.0, 1.0] }
[cameras.degradation.noise]
read_noise_e = [1.0, 50.0]
[cameras.degradation.jpeg]
quality = [20, 90]"""
LIGHT = """[vary]
images_per_setup = 2
exposure_ev = [-1.0, 1.0]
[vary.sky]
hour = [8.0, 16.0]
[vary.light]
lamp_factor = { log_uniform = [0.5, 2.0] }
lamp_temperature_k = [2500.0, 8000.0]"""


def _omnisim(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def _prepared(folder, text="", **options):
    return PreparedPlan.read(write_plan(folder, text, **options))


def test_shards_are_the_same_whatever_was_made_before(tmp_path):
    plan = write_plan(tmp_path, LIGHT, camera=CAMERA)
    assert _omnisim("generate", plan, "-o", tmp_path / "a").exit_code == 0
    for shards in ("1", "0"):
        done = _omnisim("generate", plan, "-o", tmp_path / "b", "--shards", shards)
        assert done.exit_code == 0
    for name in ("shard-000000.tar", "shard-000001.tar"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    contents = [Shards(tmp_path / "a").metadata(row) for row in range(6)]
    cameras = [json.dumps(content["images"]["camera"]["camera"]) for content in contents]
    lights = [json.dumps(content["light"]) for content in contents]
    for values in (cameras, lights):  # shards of three, setups of two
        assert values[0] == values[1] != values[2] == values[3] != values[4] == values[5]
    degradations = [content["images"]["camera"]["degradation"] for content in contents]
    assert len({degradation["exposure"]["ev"] for degradation in degradations}) == 6
    assert all(-1.0 <= degradation["exposure"]["ev"] <= 1.0 for degradation in degradations)
    noises = [degradation["parameters"]["noise"]["read_noise_e"] for degradation in degradations]
    assert len(set(noises)) == 3
    assert 1.0 <= min(noises) < max(noises) <= 50.0
    assert "lamp_factors" in contents[0]["light"]["light"]
    plain = _prepared(tmp_path).plan  # without setups all samples have the first
    indices = [draw_indices(plain, number) for number in range(200)]
    assert {(index.light, index.camera) for index in indices} == {(0, 0)}


def test_parameters_are_added_to(tmp_path):
    prepared = _prepared(tmp_path, camera=CAMERA)
    before = prepared.rigs[0].first.model
    found = [setup_rig(prepared, 0, setup).first for setup in range(60)]
    scale = 32 / 360  # of the image, to the file's
    focal_px = np.array([camera.model.focal_length_px for camera in found])
    added = (focal_px - before.focal_length_px) / scale
    assert -20.0 <= added.min() < -10.0
    assert 10.0 < added.max() <= 20.0
    shifts = np.array([one.model.principal_point_px for one in found]) - before.principal_point_px
    assert np.abs(np.corrcoef(shifts.T)[0, 1]) < 0.4  # u and v each have their own
    turned = [np.degrees(np.arccos((np.trace(one.base_from_rig[:3, :3]) - 1) / 2)) for one in found]
    assert 0.5 < np.mean(turned) < 3.0


@pytest.mark.parametrize(("kelvin", "xy"), [(2856.0, (0.4476, 0.4074)), (6500.0, (0.3135, 0.3237))])
def test_black_bodies_are_those_of_the_tables(kelvin, xy):
    """Illuminant A, and the Planckian locus at 6500 K: Wyszecki and Stiles, 2000."""
    xyz_from_srgb = np.linalg.inv(
        [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
    )
    x, y, z = xyz_from_srgb @ black_body_rgb(kelvin)
    np.testing.assert_allclose((x / (x + y + z), y / (x + y + z)), xy, atol=2e-3)
    assert y == pytest.approx(1.0, abs=1e-3)


def test_the_sun_is_where_the_hour_says(tmp_path):
    text = "[vary.sky]\nhour = 12.0\nday = 80\nlatitude_deg = 50.0\nyaw_deg = 0.0"
    prepared = _prepared(tmp_path, text, scene="courtyard")
    lights = setup_light(prepared, 0, 3).scene.lighting.lights
    (sun,) = [light for light in lights if light.kind is LightKind.DIRECTIONAL]
    assert np.degrees(np.arcsin(-sun.direction[2])) == pytest.approx(40.0, abs=1.0)  # equinox
    assert sun.direction[1] > 0.7  # from the south, and y is north
    assert abs(sun.direction[0]) < 0.06


def test_lamps_have_factors_of_their_own(tmp_path):
    text = "[vary.light]\nlamp_factor = [0.0, 2.0]\nambient_factor = 0.5"
    prepared = _prepared(tmp_path, text, scene="courtyard")
    before = prepared.scene(0).lighting
    drawn = setup_light(prepared, 0, 1)
    lamps = zip(before.lights, drawn.scene.lighting.lights, strict=True)
    factors = [new.intensity / old.intensity for old, new in lamps]
    assert factors == pytest.approx(drawn.values["light"]["lamp_factors"])
    assert len(set(factors)) == len(factors)
    np.testing.assert_allclose(drawn.scene.lighting.ambient, 0.5 * np.array(before.ambient))


def test_exposure_is_in_stops(tmp_path):
    images = []
    for ev in (-2.0, -1.0):
        prepared = _prepared(tmp_path, f"[vary]\nexposure_ev = {ev}")
        renderer = SampleRenderer(prepared)
        frame = renderer.render(0).frames[""]
        images.append(linear_from_srgb8(frame.rgb[frame.valid]).astype(float))
        renderer.close()
    darker, brighter = images
    bright = brighter > 0.1
    assert bright.sum() > 100
    np.testing.assert_allclose(brighter[bright] / darker[bright], 2.0, rtol=0.15)  # 8 bits
    assert np.median(brighter[bright] / darker[bright]) == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize(
    ("text", "camera", "message"),
    [
        ("[vary.sky]\nhour = [0.0, 12.0]", "", "hour = 0.012: expected a sun above the"),
        ('[vary.sky]\nfiles = ["no.hdr"]', "", "sky.file = 'no.hdr': no such file beside it"),
        ('[vary.sky]\nfiles = ["a.hdr"]\nhour = 9.0', "", "hour: expected a clear sky, got files"),
        ("[vary.sky]\nturbidity = [1.0, 20.0]", "", "sky.turbidity: expected 2 to 10, got"),
        ("[vary]\nhour = [8, 9]", "", "vary.hour: unknown key; expected in [vary.sky]"),
        ("[vary.light]\nlamp_factor = [-1.0, 1.0]", "", "lamp_factor: expected factors of at"),
        ("[vary.light]\nlamp_temperature_k = 10.0", "", "temperature_k: expected 1667 to 25000"),
        ("", "parameters = { focal = 1.0 }", "focal: not a parameter of 'hyperbolic': did you"),
        ("", "parameters = { xi = 0.1 }", "parameters.xi: follows from the other parameters"),
        ("", "parameters = { focal_length_px = [-9e3, 0] }", "focal_length_px: expected"),
        ("", "degradation = { noise = { read = 1.0 } }", "noise.read: unknown key; did you mean"),
        ("", "degradation = { jpeg = { quality = [50, 200] } }", "jpeg.quality: expected"),
        ("[vary]\nexposure_ev = 1.0", 'preset = "webcam"', "meters its exposure: expected"),
    ],
)  # fmt: skip
def test_faults_are_one_line_before_anything_is_made(tmp_path, text, camera, message):
    plan = write_plan(tmp_path, text, camera=camera)
    done = _omnisim("generate", plan, "-o", tmp_path / "out")
    assert isinstance(done.exception, OmnisimError)
    assert message in str(done.exception)
    assert "\n" not in str(done.exception)
    assert not (tmp_path / "out").exists()


def test_values_that_cannot_be_are_drawn_again(tmp_path):
    camera = "degradation = { jpeg = { quality = { normal = [60.0, 13.0] } } }"
    prepared = _prepared(tmp_path, camera=camera)
    prepared.check_setups()  # three deviations are within 1 to 100
    found = [setup_rig(prepared, 0, setup).first.degradation.jpeg.quality for setup in range(100)]
    assert 1 <= min(found) < max(found) <= 100
