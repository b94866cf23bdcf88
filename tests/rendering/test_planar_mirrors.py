"""Planar mirrors of the virtual cameras beside the rays' reflections."""

import dataclasses

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from omnisim import OmniCamera
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.rays.shading import ray_optics
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING
from omnisim.scene.model import Fog, Material, Texture
from omnisim.validation.image_differences import psnr_db, psnr_of_levels_db
from omnisim.validation.traced_light import fisheye
from tests.rendering.opengl.sheets import CHROME, LAMP, PANE, SUN, mixed_scene, with_mirrors
from tests.scenes import room, scene_of, square
from tests.vehicles import box

pytestmark = pytest.mark.usefixtures("needs_opengl")
pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

AT = pose((-1.0, 0.2, 0.3), yaw_deg=-5.0)


def _moving():
    """A mirror that moves, and flips its triangles."""
    return scene_of(
        [square(0.5)],
        [dataclasses.replace(CHROME, double_sided=True)],
        [pose(roll_deg=75.0) @ np.diag((1.0, 1.0, -1.0, 1.0))],
    )


def _seen(scene, sensor, backend, at=AT):
    with (
        Stage(scene, dynamic_objects={"door": _moving()}, backend=backend) as stage,
        stage.open(sensor) as renderer,
    ):
        door = pose((0.6, -1.1, 0.1), yaw_deg=-40.0)
        state = WorldState({renderer.vehicle: at, "door": door})
        return np.clip(renderer.render(state, linear=True).linear[..., :3], 0.0, 1.0)


@pytest.fixture(scope="module")
def scene():
    return with_mirrors(mixed_scene(SUN, LAMP))


def _db(ours, traced):
    return psnr_db(ours, traced, np.ones(ours.shape[:2], dtype=bool))


@pytest.mark.parametrize(
    ("sensor", "fog"),
    [(fisheye(120), None), (OmniCamera().resized(120), Fog((0.3, 0.5, 0.7), (0.1, 0.05, 0.02)))],
    ids=["fisheye", "mirror in fog"],
)
def test_views_in_mirrors_are_those_of_rays(scene, sensor, fog, monkeypatch):
    """Boxes, coats, flipped and moving mirrors; measured: 42.7 and 43.6 dB, at edges."""
    scene = dataclasses.replace(scene, lighting=dataclasses.replace(scene.lighting, fog=fog))
    sensor = dataclasses.replace(sensor, supersampling=2, mirrors=8)
    ours = _seen(scene, sensor, "cube")
    monkeypatch.setattr(ray_optics, "MAX_BOUNCES", 1)  # mirrors in mirrors reflect the sky
    of_mirrors = _db(ours, _seen(scene, sensor, "rays"))
    monkeypatch.setattr(ray_optics, "MAX_BOUNCES", 0)
    of_sky = _db(ours, _seen(scene, sensor, "rays"))
    assert of_mirrors >= 40.0
    assert of_sky < of_mirrors - 4.0


def test_mirrors_of_all_ways_to_draw(scene):
    """Samples of texels, batches, edits and bodies without clusters show the same mirrors."""
    sensor = dataclasses.replace(fisheye(80), supersampling=2, reflection_probes=0)
    states = [AT, AT @ pose((0.2, -0.1, 0.1), yaw_deg=20.0)]
    with open_sensor(scene, sensor) as renderer:
        frames = [renderer.render(state).rgb for state in states]
        for image, frame in zip(renderer.render_batch(states), frames, strict=True):
            np.testing.assert_array_equal(image, frame)
        place = scene.instances[-6].world_from_mesh
        renderer.move(scene.instances[-6].name, place @ pose((0.0, 0.4, 0.0)))
        edited = renderer.render(AT).rgb
        with open_sensor(renderer.scene, sensor) as fresh:
            assert psnr_of_levels_db(edited, fresh.render(AT).rgb) > 50.0
    assert psnr_of_levels_db(edited, frames[0]) < 32.0
    finer = dataclasses.replace(sensor, samples=4)
    with open_sensor(scene, finer) as renderer:
        assert psnr_of_levels_db(renderer.render(AT).rgb, frames[0]) > 36.0


def test_sorted_triangles_of_panes_keep_their_planes():
    glass = dataclasses.replace(PANE, double_sided=False)
    scene = scene_of([room(), box("block", 1)], [Material(unlit=True, double_sided=True), glass])
    sensor = dataclasses.replace(fisheye(60), supersampling=1)
    behind = pose((1.5, 0.8, 0.4), yaw_deg=200.0)
    with open_sensor(scene, sensor) as renderer:
        renderer.render(pose((-1.5, -0.8, 0.2)))
        seen = renderer.render(behind).rgb
    with open_sensor(scene, sensor) as fresh:
        np.testing.assert_array_equal(seen, fresh.render(behind).rgb)
    with open_sensor(scene, sensor, backend="rays") as reference:
        assert psnr_of_levels_db(seen, reference.render(behind).rgb) > 34.0


def test_a_mirror_shows_the_housing_that_the_camera_does_not_see():
    housing = scene_of([square(0.5, 2.0)], [Material(unlit=True, double_sided=True)])
    floor = scene_of([square(100.0)], [dataclasses.replace(CHROME, base_color=(1, 1, 1, 1))])
    sensor = OmniCamera(polygons=None, base_from_rig=pose((0.0, 0.0, 3.0))).resized(91)
    with Stage(floor, housing) as stage, stage.open(sensor, hidden={"object 0"}) as renderer:
        seen = renderer.render(pose(), linear=True).linear
    np.testing.assert_allclose(seen[45, 45], 1.0, atol=1e-3)
    np.testing.assert_allclose(seen[45, 12], 0.0, atol=1e-3)


def _glossy_box(**values):
    """A box in daylight, for a viewpoint that grazes its top."""
    material = Material(base_color=(0.5, 0.4, 0.3, 1.0), specular=1.0, **values)
    return scene_of([box("box", 0)], [material], None, DEFAULT_LIGHTING, DEFAULT_BACKGROUND)


def _banded(low, high):
    """Roughness between two values along v."""
    pixels = np.full((64, 4, 4), 255, dtype=np.uint8)
    pixels[..., 1] = np.linspace(255.0 * low, 255.0 * high, 64).round()[:, None]
    return Texture(pixels, is_linear=True)


@pytest.mark.parametrize(
    "values",
    [{"roughness": 0.25}, {"metallic_roughness_map": _banded(0.2, 0.45), "metallic": 0.2}],
    ids=["grazed", "mapped"],
)
def test_glossy_boxes_are_those_of_rays(values):
    at = pose((-0.8, -0.3, 0.6), pitch_deg=10.0, yaw_deg=20.0)
    sensor = dataclasses.replace(fisheye(120), supersampling=2)
    images = []
    for backend in ("cube", "rays"):
        with open_sensor(_glossy_box(**values), sensor, backend=backend) as renderer:
            image = renderer.render(at, also=("instance",))
        images.append(image.rgba[..., :3].astype(int))
    inside = binary_erosion(image.channels["instance"] == 1, iterations=2)
    assert inside.sum() > 300
    apart = np.abs(images[0] - images[1]).max(axis=-1)[inside]
    assert np.mean(apart > 6) < 0.02
