"""Fog along the rays: its equation, in both back ends and for all optics."""

from dataclasses import replace

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.scene.model import AlphaMode, Fog, Material
from tests.cameras.optics.examples import SYSTEMS
from tests.rendering.frames import BACKENDS, each_backend, opened
from tests.scenes import room, room_color, room_hit, scene_of, square

pytestmark = pytest.mark.usefixtures("needs_opengl")

FOG = Fog((0.3, 0.5, 0.7), (0.9, 0.3, 0.1))
VIEWPOINT_M = np.array([0.4, -0.3, 0.2])


def _foggy(scene, fog=FOG):
    return replace(scene, lighting=replace(scene.lighting, fog=fog))


def _frame(scene, camera, backend, **options):
    with opened(scene, camera, backend, **options) as renderer:
        pose = renderer.camera.base_pose(VIEWPOINT_M, yaw_deg=25.0)
        return renderer.render(pose, linear=True), pose


def _seen_through(colors, distances_m):
    left = np.exp(-np.array(FOG.attenuation_per_m) * distances_m[..., None])
    return FOG.color + (colors - FOG.color) * left


@each_backend
def test_colors_of_a_room_are_those_of_the_equation(backend):
    camera = OmniCamera(polygons=None).resized(120)
    frame, pose = _frame(_foggy(scene_of([room()])), camera, backend)
    rays, valid = camera.model.ray_from_pixel(pixel_grid(120, 120))[:2]
    directions = rays @ (pose[:3, :3] @ camera.model.rig_from_optical).T
    hits_m = room_hit(VIEWPOINT_M, directions)
    distances_m = np.linalg.norm(hits_m - VIEWPOINT_M, axis=-1)
    expected = _seen_through(room_color(hits_m), distances_m)
    off = np.abs(frame.linear - expected)[valid & frame.valid]
    # a pixel is the mean of its samples: more at the corners of the room
    assert np.quantile(off, 0.98) < 0.006
    assert off.mean() < 0.002


@each_backend
def test_what_is_infinitely_far_away_has_the_color_of_the_fog(backend):
    scene = scene_of([square(0.1)], background=(1.0, 0.0, 0.0))
    camera = OmniCamera(polygons=None).resized(60)
    frame, _ = _frame(_foggy(scene), camera, backend)
    np.testing.assert_allclose(np.median(frame.linear[frame.valid], axis=0), FOG.color, atol=2e-3)
    plain = [_frame(one, camera, backend, unlit=True)[0].rgb for one in (scene, _foggy(scene))]
    assert np.array_equal(*plain)


@each_backend
def test_light_through_glass_is_as_if_it_came_through_fog_alone(backend):
    """Glass that emits what the fog would, there, changes nothing."""
    distance_m = 0.7
    camera = OmniCamera(polygons=None).resized(90)
    glass = Material(base_color=(*FOG.color, 0.5), alpha_mode=AlphaMode.BLEND, double_sided=True)
    wall = Material(base_color=(*FOG.color, 1.0), double_sided=True)
    z_m = VIEWPOINT_M[2] - distance_m
    meshes = [square(4.0, z_m - 1.0), square(4.0, z_m, material=1, name="glass")]
    through, _ = _frame(_foggy(scene_of(meshes, [wall, glass])), camera, backend)
    np.testing.assert_allclose(
        through.linear[through.valid], np.broadcast_to(FOG.color, (through.valid.sum(), 3)),
        atol=2e-3,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["port", "concave"])
def test_rays_that_do_not_meet_have_their_own_distance(name):
    """Rays that start beside the viewpoint: by distances from there, they would be off by half."""
    scene = _foggy(scene_of([room()]), Fog((0.0, 0.0, 0.0), (3.0, 2.0, 1.0)))
    camera = OmniCamera.of(SYSTEMS[name]).resized(90)
    cube, rays = (_frame(scene, camera, backend)[0] for backend in BACKENDS)
    both = cube.valid & rays.valid
    ratio = (cube.linear[both] + 1e-6) / (rays.linear[both] + 1e-6)
    assert np.abs(np.median(ratio, axis=0) - 1.0).max() < 0.003
    assert np.quantile(np.abs(ratio - 1.0), 0.98) < 0.01
