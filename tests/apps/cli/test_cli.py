"""The command line: output, files and errors."""

import json
import platform
import re
import sys
from importlib.metadata import version

import numpy as np
import pytest

from omnisim.apps.cli.info import PACKAGE
from omnisim.core.extras import install_hint
from omnisim.core.files.image_files import read_image
from omnisim.core.version import __version__
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE
from omnisim.rendering.stage import open_sensor
from omnisim.scene import load_scene


def test_render_writes_the_image_and_a_summary(quiet, tmp_path, needs_opengl):
    out = quiet("render", "courtyard", "-o", "a.png", "--size", 90, "--yaw", -30)
    assert "a.png: 90 × 90 px, 900 polygons (auto), from (0, 0, 0.9) m at yaw -30°" in out
    pixels, metadata = read_image(tmp_path / "a.png")
    assert pixels.shape == (90, 90, 3)
    assert metadata["scene"] == "courtyard"
    assert pixels.std() > 30


def test_a_surface_before_the_near_plane_is_noted(ran, needs_opengl):
    """The camera stands in the compass of the courtyard's pavement."""
    words = "render", "courtyard", "-o", "a.png", "--size", 16, "--at", 0, 0, 0.03
    assert ran(*words)[1] == (
        "note: courtyard: clipped by the near plane, 0.05 m: compass_rose "
        "(virtual_cameras.near_m of a sensor file)\n"
    )


def test_render_with_all_options(ran, tmp_path, needs_opengl):
    (tmp_path / "s.toml").write_text("[mirror]\ntheta_max_deg = 130\n[camera]\nwidth_px = 120\n")
    ran(
        "render", "courtyard", "-o", "a.exr", "--sensor", "s.toml", "--at", 1, -2, 1.2,
        "-n", "exact", "--size", 80, "--unlit", "--faces", "faces",
    )  # fmt: skip
    pixels, metadata = read_image(tmp_path / "a.exr")
    assert pixels.dtype == np.float32
    assert metadata["polygons"] == "exact"
    assert metadata["camera"]["theta_max_deg"] == pytest.approx(130.0)
    assert not metadata["lit"]
    assert {path.stem for path in (tmp_path / "faces").glob("*.png")} == {
        "front", "left", "back", "right", "down", "up", "unfolded",
    }  # fmt: skip


@pytest.mark.parametrize("backend", ["cube", "rays"])
def test_statistics_count_triangles(quiet, needs_opengl, backend):
    if backend == "rays":
        pytest.importorskip("embreex")
    render = "render", "rings", "--size", 32, "--quality", "fast", "--backend", backend
    out = quiet(*render, "--statistics", "-o", "a.png")
    camera = OmniCamera().resized(32).with_quality("fast")
    with open_sensor("rings", camera, backend=backend) as renderer:
        counted = renderer.statistics(camera.base_pose(renderer.scene.start.position_m))
    drawn = f"{counted.drawn:,} drawn by the virtual cameras, {counted.seen:,} seen"
    if backend == "rays":
        drawn = f"{counted.seen:,} seen; drawn: not available, as --backend rays draws none"
    assert f"\na.png: triangles: {counted.submitted:,} submitted, {drawn}\n" in out
    assert counted.seen > 0


def test_notices_go_to_standard_error(ran, tmp_path, needs_opengl):
    (tmp_path / "a.obj").write_text("mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    out, error = ran("render", "a.obj", "-o", "a.png", "--size", 32)
    assert error == "note: a.obj: gone.mtl is missing: drawn without it\n"
    assert "note" not in out


def test_mirror_writes_a_mesh(ran, tmp_path):
    assert "256 polygons (32 sectors × 8 rings)" in ran("mirror", "-n", 256, "-o", "m.glb")[0]
    assert load_scene(tmp_path / "m.glb").instances[0].name == "hyperbolic_mirror"


def test_polygons_are_those_of_the_option_before_those_of_the_file(ran, tmp_path, needs_opengl):
    (tmp_path / "s.toml").write_text("[mirror]\npolygons = 64\n")
    render = ("render", "rings", "-o", "a.png", "--size", 16, "--quality", "fast", "--unlit")
    assert ", 64 polygons, " in ran(*render, "--sensor", "s.toml")[0]
    assert " polygons (auto), " in ran(*render, "--sensor", "s.toml", "-n", "auto")[0]


def test_schema_prints_the_json_schema_of_a_file(quiet):
    name = json.loads(quiet("schema", "robot"))["properties"]["name"]
    assert name["description"] == "Short name for file names."


def test_sensor_prints_the_default_and_checks_a_file(ran, omnisim, tmp_path):
    out, _ = ran("sensor")
    assert out == DEFAULT_SENSOR_FILE.read_text(encoding="utf-8")
    (tmp_path / "s.toml").write_text(out)
    out, _ = ran("sensor", "--check", "s.toml")
    assert "s.toml: valid" in out
    assert "ξ = 0.9954942" in out
    assert "  mesh     3600 polygons (auto), off by 0.096 px at most\n" in out
    (tmp_path / "s.toml").write_text("[degradation.noise]\nread_noise_e = 9\n")
    assert "read_noise_e = 9.0" in ran("sensor", "--check", "s.toml")[0]
    (tmp_path / "s.toml").write_text("[mirror]\nk = 1\nc = 0\n")
    status, _, error = omnisim("sensor", "--check", "s.toml")
    assert (status, error.count("error: s.toml: mirror.")) == (1, 2)  # one line a fault


def test_info_has_what_a_bug_report_needs(ran, context, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    out, _ = ran("info")
    lines = dict(re.split(" {2,}", line, maxsplit=1) for line in out.splitlines() if "  " in line)
    assert lines["omnisim"] == f"{__version__}, in {PACKAGE}"
    assert lines["python"] == f"{platform.python_version()}, {sys.executable}"
    assert platform.release() in lines["system"]
    assert platform.machine() in lines["system"]
    assert f"numpy {version('numpy')}" in lines["packages"]
    assert "courtyard" in lines["scenes"]
    assert "superscout" in lines["robots"]
    assert lines["camera"].endswith("3600 polygons (auto), off by 0.096 px at most")
    assert lines["renderer"].startswith(f"{context.info['GL_RENDERER']}, OpenGL ")
    assert lines["video"] == f"no av: {install_hint('video')}"
    plots = f"matplotlib {version('matplotlib')}"
    assert lines["plots"] == plots
    assert lines["reports"] == f"{plots}; no jinja2: {install_hint('reports')}"
    assert {"estimators", "orb-slam3"} <= set(lines)  # long names, too, are set apart


def test_version_and_help(ran):
    assert ran("--version")[0] == f"omnisim {__version__}\n"
    assert "--faces" not in ran("render", "--help")[0]
    assert "--faces" in ran("render", "--help-all")[0]


def test_missing_opengl_is_one_line(omnisim, monkeypatch):
    from omnisim.rendering.opengl.gl import diagnosis

    monkeypatch.setattr(diagnosis, "LIBRARIES", ("libNoSuchEGL.so.1", "libGL.so.1"))
    for arguments in (("render", "courtyard", "-o", "a.png"), ("info",)):
        status, out, error = omnisim(*arguments)
        assert (status, error.count("\n")) == (1, 1)
        assert error.startswith("error: libNoSuchEGL.so.1 is missing: install OpenGL: ")
    for known in (f"{__version__}, in {PACKAGE}", "numpy", "plots", "courtyard", "superscout"):
        assert known in out  # of info, without OpenGL too
