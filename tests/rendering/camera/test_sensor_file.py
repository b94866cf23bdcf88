import math
import tomllib

import numpy as np
import pytest

from omnisim.core.errors import NoticeWarning, OpticsError, SensorFileError
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.quality import quality_named
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE


def test_documented_default_file_is_the_default():
    documented, default = OmniCamera.from_file(DEFAULT_SENSOR_FILE), OmniCamera()
    assert documented.model == default.model
    np.testing.assert_array_equal(documented.base_from_rig, default.base_from_rig)
    for name in ("polygons", "face_size_px", "near_m", "far_m", "samples", "supersampling"):
        assert getattr(documented, name) == getattr(default, name)
    assert documented.texels_per_pixel == default.texels_per_pixel


def test_empty_file_is_the_default_and_says_so(tmp_path):
    path = tmp_path / "sensor.toml"
    path.write_text("")
    with pytest.warns(NoticeWarning, match=r"sensor\.toml: is empty: the paper's camera"):
        assert OmniCamera.from_file(path).model == OmniCamera().model
    path.write_text("# the paper's camera\n")
    assert OmniCamera.from_file(path).model == OmniCamera().model


def test_every_group_is_read(tmp_path):
    path = tmp_path / "sensor.toml"
    path.write_text(
        "[mirror]\nk = 5.0\nc = 1.0\nmeters_per_unit = 0.1\nrim_radius_m = 0.03\n"
        'polygons = "exact"\n[mirror.mounting]\nposition_m = [0.1, 0.0, 0.5]\nyaw_deg = 90\n'
        "[virtual_cameras]\nsize_px = 512\nnear_m = 0.1\nfar_m = 50\nsamples = 1\n"
        "[camera]\nwidth_px = 640\nheight_px = 480\nfocal_length_px = 900\n"
        "principal_point_px = [320.5, 239.5]\nsupersampling = 3\n"
    )
    sensor = OmniCamera.from_file(path)
    assert sensor.polygons is None
    assert sensor.model.mirror.k == 5.0
    assert sensor.model.mirror.rim_radius_m == pytest.approx(0.03)
    assert (sensor.model.width_px, sensor.model.height_px) == (640, 480)
    assert sensor.model.focal_length_px == 900.0
    assert sensor.model.principal_point_px == (320.5, 239.5)
    assert sensor.supersampling == 3
    assert (sensor.face_size_px, sensor.near_m, sensor.far_m, sensor.samples) == (512, 0.1, 50, 1)
    np.testing.assert_allclose(sensor.base_from_rig[:3, 3], (0.1, 0.0, 0.5))
    np.testing.assert_allclose(sensor.base_from_rig[:3, 0], (0.0, 1.0, 0.0), atol=1e-15)


@pytest.mark.parametrize(
    ("key", "default", "most"), [("mirrors", 4, 8), ("reflection_probes", 8, 16)]
)
def test_numbers_of_mirrors_and_probes_are_written_unless_they_are_the_defaults(key, default, most):
    for number in (0, default, most):
        text = OmniCamera(**{key: number}).to_toml()
        assert (key in text) == (number != default)
        assert getattr(OmniCamera.from_table(tomllib.loads(text)), key) == number
    with pytest.raises(OpticsError, match=f"{key}: expected a number ≤ {most}, got {most + 1}"):
        OmniCamera(**{key: most + 1})


def test_base_pose_puts_the_viewpoint_at_the_point():
    """Whatever the mounting: the base pose puts the effective viewpoint at the given point."""
    sensor = OmniCamera.from_table(
        {"mirror": {"mounting": {"position_m": [0.3, 0.1, 0.8], "pitch_deg": 5.0}}}
    )
    world_from_rig = sensor.base_pose((1.0, 2.0, 3.0), yaw_deg=70.0) @ sensor.base_from_rig
    np.testing.assert_allclose(world_from_rig[:3, 3], (1.0, 2.0, 3.0), atol=1e-15)


def test_resizing_keeps_the_view():
    sensor = OmniCamera()
    larger = sensor.resized(720)
    assert (larger.model.width_px, larger.model.height_px) == (720, 720)
    assert larger.model.rim_radius_px == pytest.approx(360.0)
    # the same corner of the image sees the same ray
    one = sensor.model.ray_from_pixel((-0.5, 100.5)).directions
    np.testing.assert_allclose(larger.model.ray_from_pixel((-0.5, 201.5)).directions, one)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("mirror.k = 1.5", r"mirror\.k: expected a number ≥ 2.*, got 1\.5"),
        ("mirror.k = 'big'", r"mirror\.k: expected a number.*, got 'big'"),
        ("mirror.k = nan", r"mirror\.k: expected a finite number.*, got nan"),
        ("mirror.k = 1e200", r"mirror\.k: expected a number ≤ 1e\+06, got 1e\+200"),
        ("mirror.c = 1e300", r"c · meters_per_unit: expected 1e-06 to 1e\+06 m, got 4e\+298 m"),
        ("mirror.k = '11'", r"mirror\.k: expected a number.*, got '11'"),
        ("mirror.c = true", r"mirror\.c: expected a number.*, got True"),
        ("mirror.mounting.position_m = 'a'", "position_m: expected a list of numbers.*, got 'a'"),
        ("mirror.c = 0", r"mirror\.c: expected a number > 0.*, got 0"),
        ("mirror.c = -2.3", r"mirror\.c: expected a number > 0.*, got -2\.3"),
        ("mirror.thetamax_deg = 3", "thetamax_deg: unknown key; did you mean 'theta_max_deg'"),
        ("mirror.theta_max_deg = 156", r"theta_max_deg = 156: .*asymptote .* 155\.405°"),
        ("mirror.theta_max_deg = 0", "theta_max_deg: expected a number > 0, got 0"),
        ("mirror.rim_radius_m = 0", "rim_radius_m: expected a number > 0.*, got 0"),
        ("mirror.theta_max_deg = 90\nmirror.rim_radius_m = 1", "theta_max_deg and rim_radius"),
        ("mirror.shape = 'spherical'", r"mirror\.shape: expected 'hyperbolic'.*, got 'spherical'"),
        ("mirror.polygons = 'many'", r"polygons: expected a whole number, 'auto' or 'exact', got"),
        ("mirror.polygons = 1009", r"mirror\.polygons = 1009: .*nearest 1008 and 1012"),
        ("mirror.polygons = 10.5", r"mirror\.polygons: expected a whole number.*, got 10\.5"),
        ("mirror.polygons = true", r"mirror\.polygons: expected a whole number.*, got True"),
        ("mirror.mounting.position_m = [0, 0]", r"mirror\.mounting\.position_m\.2: missing"),
        ("mirror.mounting.yaw_deg = inf", r"\.yaw_deg: expected a finite number.*, got inf"),
        ("virtual_cameras.size_px = 0", r"\.size_px: expected 1 to 32768 or 'auto'.*, got 0"),
        ("virtual_cameras.near_m = 0", "near_m: expected a number > 0.*, got 0"),
        ("virtual_cameras.far_m = 0.01", r"far_m: expected more than near_m = 0\.05, got 0\.01"),
        ("virtual_cameras.samples = 3", "samples: expected 1, 2, 4 or 8.*, got 3"),
        ("virtual_cameras.mirrors = 9", "mirrors: expected a number ≤ 8.*, got 9"),
        ("virtual_cameras.reflection_probes = -1", "probes: expected a number ≥ 0.*, got -1"),
        ("camera.width_px = 0", r"camera\.width_px: expected a number ≥ 1.*, got 0"),
        ("camera.height_px = 1e9", r"camera\.height_px: expected a whole number.*, got 1000"),
        ("camera.focal_length_px = 'near'", "expected a number > 0 or 'fit'.*, got 'near'"),
        ("camera.focal_length_px = -1", "focal_length_px: expected a number > 0.*, got -1"),
        ("camera.principal_point_px = [1]", r"principal_point_px: expected \[u, v\].*, got \[1\]"),
        ("camra.width_px = 3", "camra: unknown key; did you mean 'camera'"),
        ("mirror = 3", r"sensor\.toml: mirror: expected a table.*, got 3"),
        ("[mirror", r"sensor\.toml: not TOML: Expected"),
    ],
)
def test_every_fault_names_file_key_and_value(tmp_path, text, words):
    path = tmp_path / "sensor.toml"
    path.write_text(text)
    with pytest.raises(SensorFileError, match=words) as info:
        OmniCamera.from_file(path)
    assert "\n" not in str(info.value)


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(SensorFileError, match=r"none\.toml: cannot be read: No such file"):
        OmniCamera.from_file(tmp_path / "none.toml")
    (tmp_path / "x.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SensorFileError, match=r"x\.toml: not a text file"):
        OmniCamera.from_file(tmp_path / "x.toml")


def test_polygon_count_is_checked_in_the_library_too():
    with pytest.raises(OpticsError, match="nearest"):
        OmniCamera(polygons=1009)
    assert math.isinf(OmniCamera().far_m)


def test_a_sensor_file_extends_another(tmp_path):
    (tmp_path / "base.toml").write_text("[camera]\nwidth_px = 120\n[mirror]\ntheta_max_deg = 110\n")
    own = tmp_path / "own.toml"
    own.write_text('extends = "base.toml"\n[camera]\nquality = "fine"\n')
    camera = OmniCamera.from_file(own)
    assert camera.model == OmniCamera.from_file(tmp_path / "base.toml").model
    assert (camera.supersampling, camera.texels_per_pixel) == quality_named("fine")
    own.write_text(
        'extends = "base.toml"\n[lens]\nmodel = "equidistant"\nwidth_px = 90\nheight_px = 90\n'
        "focal_length_px = 30\nprincipal_point_px = [45, 45]\ntheta_max_deg = 90\n"
    )
    assert OmniCamera.from_file(own).model.width_px == 90
