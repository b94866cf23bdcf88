"""Errors that `omnisim sensor --check` states, against the rays of the GPU."""

import re
from pathlib import Path

import numpy as np
import pytest

from omnisim import OmniCamera
from omnisim.cameras import pixel_grid
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap

SCENES = Path(__file__).resolve().parents[3] / "scenes"
SHIPPED = [DEFAULT_SENSOR_FILE, *sorted(SCENES.glob("*/omnicam.toml"))]
STATED = re.compile(r"(\d+) polygons( \(auto\))?, off by ([\d.e+]+) px at most")


def _check_words(context, words, sensor):
    polygons, _, error_px = STATED.search(words).groups()
    assert int(polygons) == sensor.mesh_polygons
    camera = sensor.model
    rays, seen = PixelMap(context, camera, int(polygons)).read_rays()
    shown = camera.pixel_from_ray(rays[seen].astype(np.float64))
    pixels = pixel_grid(camera.width_px, camera.height_px)[seen]
    off_px = np.linalg.norm(shown.positions_px - pixels, axis=1)[shown.valid].max()
    assert 0.9 * float(error_px) < off_px <= float(error_px)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.parent.name)
def test_stated_error_of_every_shipped_sensor_file_is_true(quiet, context, path):
    out = quiet("sensor", "--check", path)
    assert "(auto)" in out
    _check_words(context, out, OmniCamera.from_file(path))


@pytest.mark.parametrize("polygons", [16, 1024])
def test_stated_error_of_a_fixed_mesh_is_true(omnisim, context, tmp_path, polygons):
    path = tmp_path / "s.toml"
    path.write_text(f"[mirror]\npolygons = {polygons}\n[camera]\nwidth_px = 500\n")
    _, out, _ = omnisim("sensor", "--check", str(path))
    assert "(auto)" not in out
    _check_words(context, out, OmniCamera.from_file(path))


def test_exact_and_too_fine_meshes_say_so(omnisim, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text('[mirror]\npolygons = "exact"\n')
    assert "  mesh     exact, none\n" in omnisim("sensor", "--check", "s.toml")[1]
    path.write_text("[camera]\nfocal_length_px = 1e7\n")
    words = "exact (auto: 0.1 px need more than 1048576 polygons), none\n"
    assert f"  mesh     {words}" in omnisim("sensor", "--check", "s.toml")[1]
