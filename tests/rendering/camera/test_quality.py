"""Named qualities: in Python, in sensor files, in a run."""

from typing import get_args

import pytest

from omnisim.core.errors import OpticsError, SensorFileError
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.quality import DEFAULT_QUALITY, QUALITIES, QualityName, quality_named
from omnisim.rendering.stage import Stage
from omnisim.scene import load_scene
from omnisim.validation.image_differences import psnr_db

LENS = {
    "model": "equidistant", "width_px": 64, "height_px": 64, "focal_length_px": 20.0,
    "theta_max_deg": 80.0, "principal_point_px": [31.5, 31.5],
}  # fmt: skip


def _numbers(sensor):
    return sensor.supersampling, sensor.texels_per_pixel


def test_quality_names_match_the_table():
    assert get_args(QualityName) == tuple(QUALITIES)
    assert _numbers(OmniCamera()) == QUALITIES[DEFAULT_QUALITY]


@pytest.mark.parametrize("name", QUALITIES)
def test_a_name_sets_both_numbers_and_nothing_else(name):
    before = OmniCamera(polygons=64, near_m=0.1, supersampling=7, texels_per_pixel=0.5)
    after = before.with_quality(name)
    assert _numbers(after) == QUALITIES[name]
    assert (after.model, after.polygons, after.near_m) == (before.model, 64, 0.1)
    assert _numbers(OmniCamera.from_table({"camera": {"quality": name}})) == QUALITIES[name]


@pytest.mark.parametrize(
    ("table", "numbers"),
    [
        ({"camera": {"quality": "fast", "supersampling": 5}}, (5, 1.0)),
        ({"camera": {"quality": "fast"}, "virtual_cameras": {"texels_per_pixel": 3.0}}, (2, 3.0)),
        ({"virtual_cameras": {"texels_per_pixel": 3.0}}, (3, 3.0)),
        ({"lens": LENS, "camera": {"quality": "fine"}}, tuple(QUALITIES["fine"])),
    ],
)
def test_explicit_keys_override_the_quality(table, numbers):
    assert _numbers(OmniCamera.from_table(table)) == numbers


@pytest.mark.parametrize("value", ["quick", 3, True])
def test_unknown_names_are_one_line(value):
    with pytest.raises(SensorFileError) as info:
        OmniCamera.from_table({"camera": {"quality": value}}, "my.toml")
    assert str(info.value) == (
        f"my.toml: camera.quality: expected 'fast', 'default' or 'fine', got {value!r}"
    )


def test_unknown_name_in_python_has_a_hint():
    with pytest.raises(OpticsError, match=r"^quality 'fin': did you mean 'fine'\?$"):
        OmniCamera().with_quality("fin")
    with pytest.raises(OpticsError, match=r"^quality 'x': expected one of fast, default, fine$"):
        quality_named("x")


@pytest.mark.usefixtures("needs_opengl")
def test_error_decreases_with_quality():
    """Against 8 × 8 samples per pixel of faces that are fine enough for all detail."""
    scene = load_scene("rings")
    sensors = {name: OmniCamera(polygons=None).with_quality(name) for name in QUALITIES}
    sensors["finest"] = OmniCamera(polygons=None, supersampling=8, texels_per_pixel=8.0)
    frames = {}
    with Stage(scene) as stage:
        for name, sensor in sensors.items():
            with stage.open(sensor.resized(100)) as renderer:
                pose = sensor.base_pose(scene.start.position_m)
                frames[name] = renderer.render(pose, linear=True)
    finest = frames["finest"]
    fast_db, default_db, fine_db = (
        psnr_db(frames[name].linear, finest.linear, frames[name].valid & finest.valid)
        for name in ("fast", "default", "fine")
    )
    assert fast_db < default_db < fine_db
