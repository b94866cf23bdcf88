"""Camera shaders of Cycles: their formula in NumPy, their text, and an image by Blender."""

import json
import math
import re
import subprocess
import sys

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.cameras.calibration import calibration_of, load_calibration
from omnisim.cameras.calibration.formats.blender_osl import expansion
from omnisim.core.errors import CalibrationError
from omnisim.core.extras import is_installed
from omnisim.core.files.image_files import read_channels
from tests.camera_examples import CAMERA_EXAMPLES

# Residuals in pixels: of a cubic spline of 256 intervals, and of a polynomial of degree 8.
RESIDUALS = {
    "hyperbolic-paper": 1e-5, "elliptic": 1e-5, "perspective-wide": 1e-4,
    "orthographic-full": 1e-5, "kannala-brandt-to-its-fold": 1e-5,
    "kannala-brandt-skewed": 1e-5, "eucm-to-its-fold": 1e-5, "radial-table": 1e-3,
    "unified-kitti-360": 1e-3, "rational-polynomial-kinect": 1e-2, "thin-prism-fisheye-aria": 1e-5,
    "ocamcalib-fisheye": 1e-5,
}  # fmt: skip


@pytest.mark.parametrize("name", RESIDUALS)
def test_the_shaders_formula_is_the_model_to_its_residual(name):
    camera = CAMERA_EXAMPLES[name]
    found, stated_px = expansion(camera)
    assert stated_px < RESIDUALS[name]
    pixels = pixel_grid(camera.width_px, camera.height_px)[3::7, 2::7]  # others than were fitted
    directions, valid = found.rays(pixels)
    assert np.abs(np.linalg.norm(directions, axis=-1) - 1.0).max() < 1e-12
    expected = camera.ray_from_pixel(pixels)
    assert np.mean(valid != expected.valid) < 1e-3  # at a rim, one pixel in a thousand
    seen = camera.pixel_from_ray(directions)
    both = valid & expected.valid & seen.valid
    off_px = np.linalg.norm(seen.positions_px - pixels, axis=-1)[both]
    assert off_px.max() < 2.0 * stated_px + 1e-9


def test_panoramas_and_lenses_that_it_cannot_represent_are_refused(tmp_path):
    with pytest.raises(CalibrationError, match="blender_osl has no panorama model"):
        calibration_of(CAMERA_EXAMPLES["cylindrical"]).save(tmp_path / "a.osl", "blender_osl")
    with pytest.raises(CalibrationError, match="cannot represent model 'rational_polynomial': "):
        calibration_of(CAMERA_EXAMPLES["rational-polynomial-wide"].scaled(0.3)).save(
            tmp_path / "a.osl", "blender_osl"
        )
    assert not (tmp_path / "a.osl").exists()


@pytest.mark.parametrize("name", ["elliptic", "thin-prism-fisheye-without-either"])
def test_the_camera_in_a_shader_comes_back(name, tmp_path):
    written = calibration_of(CAMERA_EXAMPLES[name], "front").save(tmp_path / "a.osl", "blender_osl")
    (note,) = written.cameras[0].notes
    assert re.fullmatch(r"the shader's rays are up to \S+ px off", note)
    camera = load_calibration(tmp_path / "a.osl").cameras[0]
    assert (camera.name, camera.camera) == ("front", CAMERA_EXAMPLES[name])


def test_faults_of_a_shader_are_named(tmp_path):
    path = tmp_path / "a.osl"
    path.write_text("shader a() {}\n")
    with pytest.raises(CalibrationError, match="expected a camera shader that omnisim wrote"):
        load_calibration(path, "blender_osl")
    path.write_text('// omnisim\'s camera: {"camera": {"model": "eucm"}}\n')
    with pytest.raises(CalibrationError, match=r"a\.osl: .*: missing"):
        load_calibration(path)


SCRIPT = """
import json, sys
import bpy

path, output, width, height = json.loads(sys.argv[-1])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.samples = 1
scene.cycles.use_denoising = False
scene.cycles.pixel_filter_type = "BOX"
scene.cycles.filter_width = 0.01
scene.render.resolution_x, scene.render.resolution_y = width, height
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.view_settings.view_transform = "Raw"
scene.render.filepath = output
world = scene.world = bpy.data.worlds.new("world")
world.use_nodes = True
links, nodes = world.node_tree.links, world.node_tree.nodes
ray = nodes.new("ShaderNodeTexCoord")
scaled = nodes.new("ShaderNodeVectorMath")
scaled.operation = "MULTIPLY_ADD"
scaled.inputs[1].default_value = scaled.inputs[2].default_value = (0.5, 0.5, 0.5)
links.new(ray.outputs["Generated"], scaled.inputs[0])
links.new(scaled.outputs[0], nodes["Background"].inputs["Color"])
data = bpy.data.cameras.new("camera")
data.type, data.custom_mode, data.custom_filepath = "CUSTOM", "EXTERNAL", path
camera = scene.camera = bpy.data.objects.new("camera", data)
scene.collection.objects.link(camera)
bpy.context.view_layer.update()
bpy.ops.render.render(write_still=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(not is_installed("bpy"), reason="Blender's module bpy is not installed")
@pytest.mark.parametrize("name", ["kannala-brandt-tum-vi", "unified-kitti-360", "hyperbolic-paper"])
def test_cycles_casts_the_models_rays(name, tmp_path):
    """An image of the directions in which Cycles looks."""
    camera = CAMERA_EXAMPLES[name]
    calibration_of(camera).save(tmp_path / "camera.osl", "blender_osl")
    paths = [str(tmp_path / "camera.osl"), str(tmp_path / "rays.exr")]
    arguments = json.dumps([*paths, camera.width_px, camera.height_px])
    command = [sys.executable, "-c", SCRIPT, arguments]
    run = subprocess.run(command, capture_output=True, text=True, timeout=500, check=False)
    assert (tmp_path / "rays.exr").exists(), run.stdout + run.stderr
    values = read_channels(tmp_path / "rays.exr").values
    colors = np.stack([values[channel] for channel in "RGB"], axis=-1).astype(np.float64)
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    black = ~colors.any(axis=-1)
    assert np.mean(black == rays.valid) < 2e-3  # at the rim
    both = ~black & rays.valid
    world = 2.0 * colors - 1.0  # x right, y up, z backward
    seen = camera.pixel_from_ray(world * (1.0, -1.0, -1.0))
    both &= seen.valid
    off_px = np.linalg.norm(
        seen.positions_px - pixel_grid(camera.width_px, camera.height_px), axis=-1
    )
    assert both.sum() > 0.3 * both.size
    # a sample is within 0.005 px of the center in u and v; floats and residual are below 0.005 px
    assert off_px[both].max() < 0.005 * math.sqrt(2.0) + 0.005
