"""The command line: output, files and errors."""

import json
import platform
import re
import subprocess
import sys
from importlib.metadata import version

import numpy as np
import pytest

from omnisim.apps.cli.info import PACKAGE
from omnisim.core.extras import install_hint
from omnisim.core.files.image_files import read_image
from omnisim.core.version import __version__
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE
from omnisim.scene import load_scene


@pytest.mark.usefixtures("needs_opengl")
def test_render_writes_the_image_and_a_summary(omnisim, tmp_path):
    status, out, _ = omnisim("render", "courtyard", "-o", "a.png", "--size", 90, "--yaw", -30)
    assert status == 0
    assert "a.png: 90 × 90 px, 900 polygons (auto), from (0, 0, 0.9) m at yaw -30°" in out
    pixels, metadata = read_image(tmp_path / "a.png")
    assert pixels.shape == (90, 90, 3)
    assert metadata["scene"] == "courtyard"
    assert pixels.std() > 30


@pytest.mark.usefixtures("needs_opengl")
def test_a_surface_before_the_near_plane_is_noted(omnisim):
    """The camera stands in the compass of the courtyard's pavement."""
    words = "render", "courtyard", "-o", "a.png", "--size", 16, "--at", 0, 0, 0.03
    status, _, error = omnisim(*words)
    assert (status, error) == (
        0,
        "note: courtyard: nearer than the near plane, 0.05 m, and not seen there: compass_rose "
        "(virtual_cameras.near_m of a sensor file)\n",
    )


@pytest.mark.usefixtures("needs_opengl")
def test_render_with_all_options(omnisim, tmp_path):
    (tmp_path / "s.toml").write_text("[mirror]\ntheta_max_deg = 130\n[camera]\nwidth_px = 120\n")
    status, out, _ = omnisim(
        "render", "courtyard", "-o", "a.exr", "--sensor", "s.toml", "--at", 1, -2, 1.2,
        "-n", "exact", "--size", 80, "--unlit", "--faces", "faces",
    )  # fmt: skip
    assert status == 0, out
    pixels, metadata = read_image(tmp_path / "a.exr")
    assert pixels.dtype == np.float32
    assert metadata["polygons"] == "exact"
    assert metadata["camera"]["theta_max_deg"] == pytest.approx(130.0)
    assert not metadata["lit"]
    assert {path.name for path in (tmp_path / "faces").iterdir()} == {
        f"{name}.png" for name in ("front", "left", "back", "right", "down", "up", "unfolded")
    }


def test_notices_go_to_standard_error(omnisim, tmp_path, needs_opengl):
    (tmp_path / "a.obj").write_text("mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    status, out, error = omnisim("render", "a.obj", "-o", "a.png", "--size", 32)
    assert status == 0
    assert error == "note: a.obj: gone.mtl is not there: drawn without it\n"
    assert "note" not in out


def test_mirror_writes_a_mesh(omnisim, tmp_path):
    status, out, _ = omnisim("mirror", "-n", 256, "-o", "m.glb")
    assert status == 0
    assert "256 polygons (32 sectors × 8 rings)" in out
    assert load_scene(tmp_path / "m.glb").instances[0].name == "hyperbolic_mirror"
    status, _, error = omnisim("mirror", "-n", 0, "-o", "n.glb")
    assert (status, error) == (1, "error: mirror: expected 8 to 1048576 polygons, got 0\n")
    assert not (tmp_path / "n.glb").exists()


@pytest.mark.usefixtures("needs_opengl")
def test_polygons_are_those_of_the_option_before_those_of_the_file(omnisim, tmp_path):
    (tmp_path / "s.toml").write_text("[mirror]\npolygons = 64\n")
    render = ("render", "rings", "-o", "a.png", "--size", 48, "--quality", "fast")
    assert ", 484 polygons (auto), " in omnisim(*render)[1]
    assert ", 64 polygons, " in omnisim(*render, "--sensor", "s.toml")[1]
    assert ", 484 polygons (auto), " in omnisim(*render, "--sensor", "s.toml", "-n", "auto")[1]
    assert ", exact, " in omnisim(*render, "-n", "exact")[1]


def test_schema_prints_the_json_schema_of_a_file(omnisim):
    status, out, _ = omnisim("schema", "robot")
    assert status == 0
    assert json.loads(out)["properties"]["name"]["description"] == "Short name for file names."


def test_sensor_prints_the_default_and_checks_a_file(omnisim, tmp_path):
    status, out, _ = omnisim("sensor")
    assert status == 0
    assert out == DEFAULT_SENSOR_FILE.read_text(encoding="utf-8")
    (tmp_path / "s.toml").write_text(out)
    status, out, _ = omnisim("sensor", "--check", "s.toml")
    assert status == 0
    assert "s.toml: valid" in out
    assert "ξ = 0.9954942" in out
    assert "  mesh     3600 polygons (auto), off by 0.096 px at most\n" in out
    (tmp_path / "s.toml").write_text("[mirror]\nk = 1\nc = 0\n")
    status, _, error = omnisim("sensor", "--check", "s.toml")
    assert status == 1
    assert error.count("error: s.toml: mirror.") == 2  # one line a fault


@pytest.mark.usefixtures("needs_opengl")
def test_info_has_what_a_bug_report_needs(omnisim):
    status, out, _ = omnisim("info")
    assert status == 0
    lines = dict(line.split(maxsplit=1) for line in out.splitlines() if line[:1].isalpha())
    assert lines["omnisim"] == f"{__version__}, in {PACKAGE}"
    assert lines["python"] == f"{platform.python_version()}, {sys.executable}"
    assert platform.release() in lines["system"]
    assert platform.machine() in lines["system"]
    assert f"numpy {version('numpy')}" in lines["packages"]
    assert "courtyard" in lines["scenes"]
    assert "superscout" in lines["robots"]
    assert lines["camera"].endswith("3600 polygons (auto), off by 0.096 px at most")
    assert "OpenGL" in out


def test_info_tells_how_to_get_a_missing_extra(omnisim, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    _, out, _ = omnisim("info")
    out = re.sub(" {2,}", "  ", out)
    assert f"\nvideo  no av: {install_hint('video')}\n" in out
    plots = f"matplotlib {version('matplotlib')}"
    assert f"\nplots  {plots}\n" in out
    assert f"\nreports  {plots}; no jinja2: {install_hint('reports')}\n" in out


def test_info_sets_names_apart_and_names_the_renderer(omnisim, context):
    _, out, _ = omnisim("info")
    extras = [line for line in out.splitlines() if line.startswith(("estimators", "orb-slam3"))]
    assert all("  " in line for line in extras)
    assert f"\nrenderer    {context.info['GL_RENDERER']}, OpenGL " in out


def test_version_and_help(omnisim):
    assert omnisim("--version")[:2] == (0, f"omnisim {__version__}\n")
    status, out, _ = omnisim("render", "--help")
    assert (status, "--faces" in out) == (0, False)
    status, out, _ = omnisim("render", "--help-all")
    assert (status, "--faces" in out) == (0, True)


def test_missing_opengl_is_one_line(omnisim, monkeypatch):
    from omnisim.rendering.opengl.gl import diagnosis

    monkeypatch.setattr(diagnosis, "LIBRARIES", ("libNoSuchEGL.so.1", "libGL.so.1"))
    for arguments in (("render", "courtyard", "-o", "a.png"), ("info",)):
        status, out, error = omnisim(*arguments)
        assert status == 1
        assert error.startswith("error: libNoSuchEGL.so.1 is not there: install OpenGL: ")
        assert error.count("\n") == 1
        assert "cannot be used" not in out
    for known in (f"{__version__}, in {PACKAGE}", "numpy", "plots", "courtyard", "superscout"):
        assert known in out  # of info, without OpenGL too


def test_help_needs_no_graphics_library():
    """The command starts quickly: nothing heavy is imported before it is needed."""
    code = (
        "import sys, omnisim, omnisim.apps.cli.app\n"
        "heavy = {'moderngl', 'trimesh', 'numpy', 'OpenImageIO', 'PIL', 'matplotlib'}\n"
        "heavy &= set(sys.modules)\n"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
