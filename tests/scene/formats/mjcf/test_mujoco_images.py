"""Images of models are those of MuJoCo's own renderer, under light from everywhere."""

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from omnisim import OmniCamera
from omnisim.cameras import PerspectiveCamera
from omnisim.follow import MujocoStage
from tests.scene.formats.mjcf.models import SHAPES

mujoco = pytest.importorskip("mujoco")
WIDTH_PX, HEIGHT_PX, FOV_Y_DEG = 400, 300, 50.0


def _lit_from_everywhere(text):
    """Model, and data, under light from everywhere."""
    model = mujoco.MjModel.from_xml_string(text)
    model.vis.headlight.ambient[:] = 1.0
    model.vis.headlight.diffuse[:] = model.vis.headlight.specular[:] = 0.0
    model.light_active[:] = 0
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _theirs(model, data, camera, size_px=(WIDTH_PX, HEIGHT_PX), **options):
    """Image and geoms by MuJoCo's renderer."""
    from tests.scene.formats.mjcf.mujoco_images import render

    try:
        return render(model, data, camera, *size_px, **options)
    except (OSError, mujoco.FatalError) as reason:
        pytest.skip(f"MuJoCo's renderer does not work here: {reason}")


def _lens(width_px, height_px):
    focal_px = 0.5 * height_px / np.tan(np.radians(0.5 * FOV_Y_DEG))
    middle = (0.5 * (width_px - 1), 0.5 * (height_px - 1))
    return PerspectiveCamera(width_px, height_px, focal_px, middle)


@pytest.fixture(scope="module")
def images():
    """Image and geoms of MuJoCo, and of omnisim."""
    model, data = _lit_from_everywhere(SHAPES)
    theirs = _theirs(model, data, "view")
    camera = OmniCamera(_lens(WIDTH_PX, HEIGHT_PX), supersampling=2)
    with MujocoStage(model, data) as stage:
        opened = stage.open(camera, vehicle="camera/view", unlit=True)
        frame = opened.render(stage.now(), also=("instance",))
        return theirs, (frame.rgb, stage.geom_ids(frame)), stage.geoms


@pytest.mark.usefixtures("needs_opengl")
def test_each_pixel_has_the_geom_that_mujoco_draws(images):
    (_, theirs), (_, ours), _ = images
    assert (theirs == ours).mean() > 0.999  # others are on silhouettes


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(
    "lens",
    [
        'fovy="50"',
        'sensorsize="4e-3 3e-3" focal="3e-3 3e-3"',
        'sensorsize="4e-3 3e-3" focalpixel="330 300" principalpixel="30 20"',
    ],
)
def test_lenses_of_the_model_see_what_they_see_in_mujoco(lens):
    size = f'resolution="{WIDTH_PX} {HEIGHT_PX}"'
    camera = f'<camera name="own" pos="0 -5.5 4.5" xyaxes="1 0 0 0 .65 .76" {size} {lens}/>'
    model = mujoco.MjModel.from_xml_string(SHAPES.replace("</worldbody>", f"{camera}</worldbody>"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    _, theirs = _theirs(model, data, "own")
    with MujocoStage(model, data) as stage:
        own = stage.open(stage.lens_of("own"), vehicle="camera/own")
        ours = stage.geom_ids(own.render(stage.now(), also=("instance",)))
    assert (theirs == ours).mean() > 0.999


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(
    "name",
    ["floor", "ball/sphere", "can/side", "pill/capsule", "egg/ellipsoid", "crate/box",
     "ground/hfield", "tet/tetra"],
)  # fmt: skip
def test_colors_and_textures_are_those_that_mujoco_draws(images, name):
    (theirs, their_ids), (ours, our_ids), geoms = images
    is_seen = (their_ids == geoms[name]) & (our_ids == geoms[name])
    spread = maximum_filter(theirs, (3, 3, 1)).astype(int) - minimum_filter(theirs, (3, 3, 1))
    is_seen &= spread.max(axis=-1) <= 24  # edges of objects and textures are filtered otherwise
    assert is_seen.sum() > 300
    steps = np.abs(theirs.astype(int) - ours)[is_seen].max(axis=-1)
    assert np.median(steps) <= 2
    assert (steps <= 8).mean() > 0.99


@pytest.mark.usefixtures("needs_opengl")
def test_planes_mirror_what_mujoco_mirrors():
    """MuJoCo adds mirrored geoms to the floor's color: they show in its black squares."""
    pytest.importorskip("embreex", reason="embreex, which casts mirrored rays, is missing")
    size_px = (200, 150)
    model, data = _lit_from_everywhere(SHAPES.replace('reflectance=".2"', 'reflectance="1"'))
    theirs, ids = _theirs(model, data, "view", size_px, mirrors=True)
    plain, _ = _theirs(model, data, "view", size_px)
    camera = OmniCamera(_lens(*size_px), supersampling=1)
    with MujocoStage(model, data) as stage:
        opened = stage.open(camera, vehicle="camera/view")
        frame = opened.render(stage.now(), also=("instance", "semantic_through"))
        floor = (ids == stage.geoms["floor"]) & (stage.geom_ids(frame) == ids)
    black = floor & (maximum_filter(plain, (3, 3, 1)).max(axis=-1) < 10)
    mirrored = theirs.max(axis=-1) > 40
    ours = frame.channels["semantic_through"] > 0
    assert 200 < (black & mirrored).sum() < 0.5 * black.sum()
    assert (mirrored == ours)[black].mean() > 0.995  # others are on silhouettes
