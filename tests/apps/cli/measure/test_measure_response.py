"""`omnisim measure response`: encoding and vignetting of a simulated camera."""

import json

import numpy as np
import pytest

from omnisim.core.files.image_files import write_numbers
from omnisim.rendering.camera.degradations import Vignetting
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.apps.cli.measure.conftest import write_series
from tests.measurement.response.test_response import shoulder

GEOMETRY = ImageGeometry(160, 120, (79.5, 59.5))
VIGNETTING = Vignetting((-0.35, 0.1, -0.02))


@pytest.fixture
def folders(response_series, tmp_path):
    (tmp_path / "flat").mkdir()
    light = VIGNETTING.apply(np.full((120, 160, 4), 0.8, dtype=np.float32), GEOMETRY)[..., 1]
    random = np.random.default_rng(4)
    for index in range(16):
        noisy = light**0.5 + 0.003 * random.normal(size=light.shape)
        image = np.rint(255.0 * np.clip(noisy, 0.0, 1.0)).astype(np.uint8)
        write_numbers(tmp_path / "flat" / f"{index}.png", image)
    return tmp_path


RESPONSE = ("measure", "response", "series", "-o", "camera.toml")


def test_encoding_and_vignetting_are_written(ran, folders):
    out, _ = ran(*RESPONSE, "--flat", "flat")
    degradation = OmniCamera.from_file(folders / "camera.toml").degradation
    assert degradation.encoding.gamma == pytest.approx(2.0, rel=0.01)
    measured = degradation.vignetting.apply(np.ones((120, 160, 4), dtype=np.float32), GEOMETRY)
    truth = VIGNETTING.apply(np.ones((120, 160, 4), dtype=np.float32), GEOMETRY)
    assert np.abs(measured - truth).max() < 0.005
    report = json.loads((folders / "camera.json").read_text())["response"]
    assert report["vignetting"]["gray"]["residual"] < 0.01
    assert "errors of full scale: linear" in out


def test_flat_fields_of_another_camera_are_refused(ran, refused, folders):
    (folders / "lens.toml").write_text("[mirror]\nk = 12.0\n")
    options = ("--flat", "flat", "--sensor", "lens.toml")
    line = refused(*RESPONSE, *options)
    assert line == "flat: 160 × 120 px: expected 360 × 360 px as in lens.toml"
    (folders / "lens.toml").write_text("[degradation.jpeg]\n")  # states no camera
    ran(*RESPONSE, *options)
    assert "[mirror" not in (folders / "camera.toml").read_text()


def write_color_flats(folder, tint):
    """Replace the flat fields by colored ones, of gamma 2."""
    light = VIGNETTING.apply(np.full((120, 160, 4), 0.6, dtype=np.float32), GEOMETRY)[..., :3]
    random = np.random.default_rng(5)
    for path in folder.iterdir():
        noisy = (light * tint) ** 0.5 + 0.003 * random.normal(size=light.shape)
        write_numbers(path, np.rint(255.0 * np.clip(noisy, 0.0, 1.0)).astype(np.uint8))


@pytest.mark.parametrize("tint", [(0.8, 1.0, 1.1), (1.0, 1.0, 1.0)])
def test_white_balance_is_that_of_the_flat_fields(ran, folders, tint):
    write_color_flats(folders / "flat", tint)
    ran(*RESPONSE, "--flat", "flat")
    balance = OmniCamera.from_file(folders / "camera.toml").degradation.white_balance
    if tint == (1.0, 1.0, 1.0):
        assert balance is None
    else:
        assert balance.response == pytest.approx(tint, rel=0.005)
        assert balance.gains == (1.0, 1.0, 1.0)


def test_a_response_without_a_name_is_written_as_a_curve_and_vignetting_is_not_measured(
    ran, tmp_path
):
    write_series(tmp_path / "series", shoulder)
    _, error = ran(*RESPONSE)
    assert "vignetting.coefficients not measured: no flat fields" in error
    encoding = OmniCamera.from_file(tmp_path / "camera.toml").degradation.encoding
    assert encoding.curve[0] == (0.0, 0.0)
    assert encoding.curve[-1] == (1.0, 1.0)


@pytest.mark.usefixtures("response_series")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--white", "1023"), "the brightest pixel is at 25 % of white, 1023"),
        (("--white", "100"), "the brightest pixel is at 255 % of white, 100"),
        (("--white", "3", "--black", "8"), "--white: expected a level above --black 8"),
    ],
)
def test_a_wrong_white_level_is_refused(refused, arguments, message):
    assert message in refused(*RESPONSE, *arguments)


def test_white_flat_fields_are_refused(refused, folders):
    for path in (folders / "flat").iterdir():
        write_numbers(path, np.full((120, 160), 255, np.uint8))
    line = refused(*RESPONSE, "--flat", "flat")
    assert "100 % of the pixels are white: expected a shorter exposure" in line
