"""Lenses of cameras in scene files: a point is where the file's own formula says."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

from omnisim.apps.cli.app import app
from omnisim.apps.cli.images.requests import CameraViewpointOptions
from omnisim.apps.cli.inputs import Viewpoint
from omnisim.cameras import FThetaInverseCamera, PerspectiveCamera
from omnisim.core.errors import OutputError
from omnisim.core.extras import is_installed
from omnisim.core.poses import pose, rotation_from_roll_pitch_yaw
from omnisim.scene import load_scene
from tests.scene.gltf_builder import GltfBuilder

STAGE = """#usda 1.0
(
    upAxis = "Z"
    metersPerUnit = 1
)
def Cube "cube" {{
    double size = 1
}}
def Camera "shot" {{
    {camera}
}}
"""
FTHETA = """token omni:lensdistortion:model = "ftheta"
    float omni:lensdistortion:ftheta:k0 = {k0}
    float omni:lensdistortion:ftheta:k1 = 0.002
    float omni:lensdistortion:ftheta:k3 = 1e-10
    float omni:lensdistortion:ftheta:maxFov = 200
    float omni:lensdistortion:ftheta:nominalWidth = 1936
    float omni:lensdistortion:ftheta:nominalHeight = 1216
    float2 omni:lensdistortion:ftheta:opticalCenter = (970.5, 600.5)"""
OLDER = """token cameraProjectionType = "fisheyePolynomial"
    float fthetaPolyB = 0.002
    float fthetaPolyD = 1e-10
    float fthetaWidth = 1936
    float fthetaHeight = 1216
    float fthetaCx = 970.5
    float fthetaCy = 600.5
    float fthetaMaxFov = 200"""
KANNALA_BRANDT = """token omni:lensdistortion:model = "kannalaBrandtK3"
    float omni:lensdistortion:kannalaBrandtK3:k0 = 500
    float omni:lensdistortion:kannalaBrandtK3:k1 = 20
    float omni:lensdistortion:kannalaBrandtK3:k2 = -3
    float omni:lensdistortion:kannalaBrandtK3:maxFov = 180
    float omni:lensdistortion:kannalaBrandtK3:nominalWidth = 1600
    float omni:lensdistortion:kannalaBrandtK3:nominalHeight = 1200
    float2 omni:lensdistortion:kannalaBrandtK3:opticalCenter = (800, 600)"""


def _opencv(model, **values):
    lines = [f'token omni:lensdistortion:model = "{model}"']
    lines += [f"float omni:lensdistortion:{model}:{key} = {v}" for key, v in values.items()]
    return "\n    ".join([*lines, f"int2 omni:lensdistortion:{model}:imageSize = (640, 480)"])


def _stage(folder, camera):
    path = folder / "a.usda"
    path.write_text(STAGE.format(camera=camera))
    return path


@pytest.fixture(autouse=True)
def _stages_are_read_here(monkeypatch):
    from omnisim.scene.formats.usd import reader

    monkeypatch.setattr(reader, "call_isolated", lambda read, *arguments: read(*arguments))


needs_usd = pytest.mark.skipif(not is_installed("pxr"), reason="usd-core is not installed")


def _lens(folder, camera):
    """Lens of the only camera of a stage."""
    (shot,) = load_scene(_stage(folder, camera)).cameras
    return shot.lens


def _pixel(lens, x, y):
    """Pixel of a point 1 m ahead, x to the right and y down."""
    return lens.pixel_from_ray(np.array([[x, y, 1.0]])).positions_px[0]


@needs_usd
@pytest.mark.parametrize("camera", [FTHETA.format(k0=0), OLDER], ids=["schema", "older"])
def test_f_theta_lenses_of_isaac_sim(camera, tmp_path):
    lens = _lens(tmp_path, camera)
    assert isinstance(lens, FThetaInverseCamera)
    assert (lens.width_px, lens.height_px) == (1936, 1216)
    ray = lens.ray_from_pixel((970.0 + 300.0, 600.0)).directions
    assert math.atan2(ray[0], ray[2]) == pytest.approx(0.002 * 300 + 1e-10 * 300**3, 1e-6)
    assert lens.theta_edge_rad == pytest.approx(math.radians(100.0))


@needs_usd
def test_an_applied_schema_names_the_lens(tmp_path):
    """As `ApplyAPI` leaves it, with one value changed."""
    path = _stage(tmp_path, "float omni:lensdistortion:ftheta:k1 = 0.003")
    schema = '"shot" (\n    prepend apiSchemas = ["OmniLensDistortionFthetaAPI"]\n)'
    path.write_text(path.read_text().replace('"shot"', schema))
    (shot,) = load_scene(path).cameras
    assert isinstance(shot.lens, FThetaInverseCamera)
    assert shot.lens.coefficients == pytest.approx((0.003,))
    assert shot.lens.width_px == 1936


@needs_usd
def test_kannala_brandt_lenses_of_isaac_sim(tmp_path):
    theta = 0.7
    u, v = _pixel(_lens(tmp_path, KANNALA_BRANDT), math.tan(theta), 0.0)
    assert u - 799.5 == pytest.approx(500 * theta + 20 * theta**3 - 3 * theta**5, 1e-6)
    assert v == pytest.approx(599.5)


@needs_usd
def test_opencv_lenses_of_isaac_sim(tmp_path):
    x, y = 0.3, -0.2
    r = math.hypot(x, y)
    k = {"fx": 400, "fy": 410, "cx": 320, "cy": 240, "k1": 0.1, "p1": 0.01, "k4": 0.05, "s1": 0.02}
    lens = _lens(tmp_path, _opencv("opencvPinhole", **k))
    g = (1 + 0.1 * r**2) / (1 + 0.05 * r**2)
    expected = (
        319.5 + 400 * (g * x + 2 * 0.01 * x * y + 0.02 * r**2),
        239.5 + 410 * (g * y + 0.01 * (r**2 + 2 * y * y)),
    )
    np.testing.assert_allclose(_pixel(lens, x, y), expected, atol=1e-4)
    k = {"fx": 300, "fy": 300, "cx": 320, "cy": 240, "k1": 0.1, "k2": -0.01}
    lens = _lens(tmp_path, _opencv("opencvFisheye", **k))
    theta = math.atan(r)
    radius = 300 * theta * (1 + 0.1 * theta**2 - 0.01 * theta**4)
    expected = 319.5 + radius * x / r, 239.5 + radius * y / r
    np.testing.assert_allclose(_pixel(lens, x, y), expected, atol=1e-4)


@needs_usd
def test_pinholes_of_usd(tmp_path):
    """20 mm of a film 24 mm wide, whose middle is 3 mm right of the axis."""
    camera = """float focalLength = 20
    float horizontalAperture = 24
    float verticalAperture = 12
    float horizontalApertureOffset = 3"""
    lens = _lens(tmp_path, camera)
    assert (lens.width_px, lens.height_px) == (960, 480)
    u, v = _pixel(lens, 0.6, 0.3)  # at the right and the lower edge, less the offset
    assert (u, v) == (pytest.approx(479.5 + 480 - 120), pytest.approx(239.5 + 240))


@needs_usd
@pytest.mark.parametrize(
    ("camera", "words"),
    [
        (
            'token omni:lensdistortion:model = "radTanThinPrism"',
            "no model radTanThinPrism: NVIDIA does not state the unit",
        ),
        ('token omni:lensdistortion:model = "lut"', "no model lut"),
        ('token cameraProjectionType = "fisheyeSpherical"', "no model fisheyeSpherical"),
        ('token projection = "orthographic"', "it is orthographic"),
        (FTHETA.format(k0=0.1), "no f-theta lens with k0 = 0.1"),
        ("float focalLength = -1", "focal_length_px: expected"),
    ],
)
def test_a_lens_without_a_model_is_named(camera, words, tmp_path):
    scene = load_scene(_stage(tmp_path, camera))
    assert scene.cameras[0].lens is None
    (notice,) = [one for one in scene.notices if "camera 'shot'" in one]
    assert words in notice


def _command(*words):
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)


def _glb(folder, **camera):
    gltf = GltfBuilder()
    gltf.node(mesh=gltf.triangle())
    gltf.tree["cameras"] = [camera]
    gltf.node(name="shot", camera=0, translation=[0, 0, 3])
    return gltf.write(folder / "a.glb")


def test_lenses_of_gltf(tmp_path):
    lens = {"yfov": 0.8, "aspectRatio": 1.5, "znear": 0.1}
    (shot,) = load_scene(_glb(tmp_path, type="perspective", perspective=lens)).cameras
    assert (shot.lens.width_px, shot.lens.height_px) == (720, 480)
    u, v = _pixel(shot.lens, 1.5 * math.tan(0.4), math.tan(0.4))
    assert (u, v) == (pytest.approx(719.5), pytest.approx(479.5))
    scene = load_scene(_glb(tmp_path, type="orthographic", orthographic={"xmag": 1, "ymag": 1}))
    assert scene.cameras[0].lens is None
    assert scene.notices[0].endswith(
        "its pose is a viewpoint, but its lens is not used: it is orthographic"
    )


@pytest.mark.skipif(not is_installed("mujoco"), reason="MuJoCo is not installed")
def test_cameras_of_mujoco(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(
        '<mujoco><worldbody><geom type="box" size="1 1 1"/><camera name="fov" pos="5 0 1" '
        'xyaxes="0 1 0 0 0 1" fovy="60"/><camera name="sensor" pos="0 -5 0" xyaxes="1 0 0 0 0 1" '
        'sensorsize="0.006 0.004" focal="0.003 0.003" resolution="600 400"/></worldbody></mujoco>'
    )
    fov, sensor = load_scene(path).cameras
    assert fov.position_m == (5.0, 0.0, 1.0)
    assert abs(fov.yaw_deg) == pytest.approx(180.0)
    assert fov.lens.focal_length_px == pytest.approx(240 / math.tan(math.radians(30.0)))
    assert (sensor.lens.width_px, sensor.yaw_deg) == (600, pytest.approx(90.0))
    assert sensor.lens.focal_length_px == pytest.approx(300.0)


def test_cameras_of_gazebo(tmp_path):
    path = tmp_path / "a.sdf"
    path.write_text(
        '<sdf version="1.9"><model name="m"><pose>1 2 3 0 0 1</pose><link name="l">'
        "<visual name='v'><geometry><box/></geometry></visual><sensor name='eye' type='camera'>"
        "<pose>0 0 1 0 0.2 0</pose><camera><horizontal_fov>1.2</horizontal_fov>"
        "<image><width>640</width><height>480</height></image></camera></sensor></link></model></sdf>"
    )
    (eye,) = load_scene(path).cameras
    assert isinstance(eye.lens, PerspectiveCamera)
    assert (eye.name, eye.position_m) == ("m/eye", (1.0, 2.0, 4.0))
    expected = pose(
        eye.position_m, roll_deg=eye.roll_deg, pitch_deg=eye.pitch_deg, yaw_deg=eye.yaw_deg
    )
    stated = pose((1, 2, 3), yaw_deg=math.degrees(1.0)) @ pose(
        (0, 0, 1), pitch_deg=math.degrees(0.2)
    )
    np.testing.assert_allclose(expected, stated, atol=1e-6)
    assert eye.lens.focal_length_px == pytest.approx(320 / math.tan(0.6))


def test_the_command_line_draws_with_the_lens_of_the_file(tmp_path):
    path = _glb(tmp_path, type="perspective", perspective={"yfov": 0.8, "aspectRatio": 0.5})
    output = tmp_path / "a.png"
    result = _command("render", path, "--at-camera", "shot", "-o", output)
    assert "its own lens, perspective, is used" in result.output
    assert f"{output}: 240 × 480 px" in result.output
    result = _command("calibration", "show", path)
    assert "perspective" in result.output
    result = _command("scene", path, "--json")
    assert json.loads(result.output)["cameras"][0]["lens"]["model"] == "perspective"


def test_lenses_alone_in_a_stage_are_a_calibration(tmp_path):
    """In all their digits, and without usd-core."""
    output = tmp_path / "mei.usda"
    result = _command(
        "calibration",
        "convert",
        "catalog:gopro/hero11-black/wide-3840x2160",
        "--to",
        "isaac",
        "-o",
        output,
    )
    assert result.exit_code == 0, result.output
    result = _command("calibration", "show", output)
    assert "kannala_brandt" in result.output
    assert "isaac" in result.output


HALF = np.sqrt(0.5)


@pytest.fixture
def scene(tmp_path):
    gltf = GltfBuilder()
    gltf.node(mesh=gltf.triangle())
    gltf.tree["cameras"] = [{"name": "lens", "type": "perspective", "perspective": {"yfov": 1.0}}]
    gltf.node(name="level", camera=0, translation=[1, 2, 3], scale=[2, 2, 2])
    gltf.node(camera=0, rotation=[0, HALF, 0, HALF])  # 90° to the left, about the file's y
    gltf.node(name="flat", camera=0, scale=[1, 0, 1])
    gltf.node(name="far", camera=0, translation=[9e14, 0, 0], scale=[9e14, 9e14, 9e14])
    gltf.node(name="beyond", camera=0, matrix=[9e14] * 16)
    gltf.node(camera=0, rotation=[-HALF, 0, 0, HALF])  # down
    return load_scene(gltf.write(tmp_path / "a.glb"))


def test_cameras_have_the_poses_of_their_nodes(scene):
    """The file's −z is the world's +y."""
    level, left, _, down = scene.cameras  # without flat ones
    assert (level.name, left.name, down.name) == ("level", "lens", "lens_1")
    assert level.position_m == (1.0, -3.0, 2.0)
    assert (level.yaw_deg, level.pitch_deg, level.roll_deg) == (90.0, 0.0, 0.0)
    assert (abs(left.yaw_deg), left.pitch_deg, left.roll_deg) == (180.0, 0.0, 0.0)
    angles = np.radians((down.roll_deg, down.pitch_deg, down.yaw_deg))
    rotation = rotation_from_roll_pitch_yaw(*angles)
    np.testing.assert_allclose(rotation[:, 0], (0, 0, -1), atol=1e-7)  # x ahead
    np.testing.assert_allclose(rotation[:, 2], (0, 1, 0), atol=1e-7)  # the top of its image


def test_a_viewpoint_is_that_of_a_camera(scene):
    viewpoint = Viewpoint.in_scene(scene, CameraViewpointOptions(at_camera="lens"))
    assert (viewpoint.position_m, abs(viewpoint.yaw_deg)) == ((0.0, 0.0, 0.0), 180.0)
    with pytest.raises(OutputError, match="--at-camera 'lend': did you mean 'lens'"):
        Viewpoint.in_scene(scene, CameraViewpointOptions(at_camera="lend"))
    with pytest.raises(OutputError, match="--yaw: --at-camera has a pose of its own"):
        Viewpoint.in_scene(scene, CameraViewpointOptions(at_camera="lens", yaw_deg=3.0))
    with pytest.raises(OutputError, match="--at-camera 'a': the scene's file has no cameras"):
        Viewpoint.in_scene(load_scene("soccer"), CameraViewpointOptions(at_camera="a"))
