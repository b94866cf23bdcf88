"""Each check of the validation passes, and fails when the geometry is bent on purpose."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import HyperbolicCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.optics import Surface
from omnisim.core import coordinate_frames as frames
from omnisim.core import poses
from omnisim.rendering.opengl.gl import shader_files
from omnisim.validation.check_registry import CHECKS
from omnisim.validation.checks import calibration, optics
from omnisim.validation.fixture import Fixture
from omnisim.validation.oracles import omnidir
from omnisim.validation.plain_scenes import board_corners_m
from tests.slow import slow_but

pytestmark = [
    pytest.mark.usefixtures("needs_opengl"),
    # pyrender and its PyOpenGL date from 2021 and warn about today's NumPy and Python
    pytest.mark.filterwarnings("ignore"),
]
BY_KEY = {check.key: check for check in CHECKS}


@pytest.fixture(scope="module")
def fixture():
    return Fixture(is_quick=True)


@pytest.fixture(autouse=True)
def _small(monkeypatch, request):
    """Fewer markers at half the size, and fewer round trips; the bounds are the same.

    OpenCV's calibration reaches its bound with all markers alone.
    """
    if "omnidir" in request.node.name:
        return
    monkeypatch.setattr(calibration, "SIZE_PX", 512)
    monkeypatch.setattr(calibration, "MARKERS", 100)
    monkeypatch.setattr(optics, "QUICK_STEP_PX", 36)


def _missed(key, fixture):
    """Names of the bounds that a check misses."""
    check = BY_KEY[key]
    if check.skip_reason():
        pytest.skip(check.skip_reason())
    return [f"{measure.name}: {measure.value:.4g}" for measure in check.run(fixture).missed]


@pytest.mark.parametrize(
    "key",
    slow_but(
        BY_KEY,
        "viewpoint",
        "markers",
        "optics",
        long=(
            *("arcade", "baked", "materials", "noise", "optics-calibration", "optics-path-tracer"),
            *("optics-triangles", "path-tracer", "quality", "rays", "reflections"),
            *(
                "boards",
                "omnidir",
                "second-rasterizer",
                "shadows",
                "sharpness",
                "twin",
                "unwarping",
            ),
        ),
    ),
)
def test_every_bound_holds(key, fixture):
    assert not _missed(key, fixture)


@pytest.mark.parametrize(
    "key",
    slow_but(
        ["rings", "viewpoint", "omnidir", "path-tracer"],
        "viewpoint",
        long=["omnidir", "path-tracer"],
    ),
)
def test_a_wrong_mirror_is_found_out(key, fixture, monkeypatch):
    """The camera model believes in a mirror 2 % off: what is independent of it must say so."""
    true = HyperbolicMirror.half_angle_ratio.fget
    monkeypatch.setattr(
        HyperbolicMirror, "half_angle_ratio", property(lambda self: 1.02 * true(self))
    )
    assert _missed(key, fixture)


def _turn_normals(monkeypatch, roll_deg):
    normals, turned = Surface.normals, poses.pose((0.0, 0.0, 0.0), roll_deg=roll_deg)[:3, :3]
    monkeypatch.setattr(Surface, "normals", lambda self, points: normals(self, points) @ turned)


@pytest.mark.parametrize(
    ("key", "roll_deg", "measure"),
    [
        ("optics", 1e-7, "closed form"),
        pytest.param(  # a fraction of a pixel
            "optics-path-tracer", 0.1, "markers", marks=[pytest.mark.slow, pytest.mark.long]
        ),
    ],
)
def test_a_system_that_faces_aside_is_found_out(key, roll_deg, measure, fixture, monkeypatch):
    _turn_normals(monkeypatch, roll_deg)
    assert any(measure in name for name in _missed(key, fixture))


@pytest.mark.slow
@pytest.mark.long
def test_a_mirror_that_reflects_aside_is_found_out(fixture, monkeypatch):
    """The mirror that OpenCV calibrates is then no central one."""
    _turn_normals(monkeypatch, 0.5)
    aligned = optics.boards_in_mirror(fixture, optics.mirror_table(0.0, 0.0))
    size_px = optics.BOARD_IMAGE_PX
    found = omnidir.calibrate(board_corners_m(), aligned.corners, (size_px, size_px))
    assert found.rms_px > optics.RMS_BOUND_PX


@pytest.mark.slow
@pytest.mark.long
def test_rays_that_look_aside_are_found_out(fixture, monkeypatch):
    """They are turned by a quarter of a degree, a third of a pixel."""
    from omnisim.rendering.rays.caster import DepthLimits

    aim, turned = DepthLimits.aim, poses.pose((0.0, 0.0, 0.0), yaw_deg=0.25)
    monkeypatch.setattr(DepthLimits, "aim", lambda self, rig, pose: aim(self, rig, pose @ turned))
    assert _missed("rays", fixture)


@pytest.mark.slow
def test_a_wrong_calibration_file_is_found_out(fixture, monkeypatch):
    """The file's focal length is half a percent off the image's."""
    from omnisim.cameras.calibration import calibration_of

    pinhole = calibration.board_cameras()[0]
    focal_px = 1.005 * pinhole.camera.focal_length_px
    wrong = dataclasses.replace(pinhole.camera, focal_length_px=focal_px)
    monkeypatch.setattr(calibration, "board_cameras", lambda: (pinhole,))
    monkeypatch.setattr(calibration, "calibration_of", lambda camera: calibration_of(wrong))
    assert _missed("boards", fixture)


@pytest.mark.slow
def test_a_mirrored_image_is_found_out(fixture, monkeypatch):
    flipped = frames.RIG_FROM_OPTICAL_LOOKING_UP @ np.diag([-1.0, 1.0, 1.0])
    monkeypatch.setattr(HyperbolicCamera, "rig_from_optical", flipped)
    assert any("color" in name for name in _missed("orientation", fixture))


def test_a_turned_image_is_found_out(fixture, monkeypatch):
    turned = frames.RIG_FROM_OPTICAL_LOOKING_UP @ poses.rotation_from_roll_pitch_yaw(0, 0, 1e-3)
    monkeypatch.setattr(HyperbolicCamera, "rig_from_optical", turned)
    assert _missed("markers", fixture)


@pytest.mark.parametrize(
    ("key", "written", "bent"),
    [
        ("markers", "gl_FragCoord.xy - 0.5 + u_first_px", "gl_FragCoord.xy + u_first_px"),
        ("markers", "sample_at(pixel, ivec2(column, row))", "sample_at(pixel, ivec2(column, 0))"),
        *(
            pytest.param(*bent, marks=pytest.mark.slow)
            for bent in (
                ("polygons", "(0.5 - u_first_px) * seen.z", "(0.0 - u_first_px) * seen.z"),
                ("rings", "tangent * u_uv_from_tangent", "1.003 * tangent * u_uv_from_tangent"),
                ("orientation", "rig.x > 0.0 ? 0 : 2", "rig.x > 0.0 ? 2 : 0"),
            )
        ),
    ],
    ids=["half a pixel", "a row of samples", "half a pixel, mesh", "face tangent", "swapped faces"],
)
def test_a_wrong_shader_is_found_out(key, written, bent, fixture, monkeypatch):
    expand, hits = shader_files._expand, []

    def expand_bent(*arguments):
        source = expand(*arguments)
        hits.append(written in source)
        return source.replace(written, bent)

    monkeypatch.setattr(shader_files, "_expand", expand_bent)
    assert _missed(key, fixture)
    assert any(hits)
