"""Reflections by rays: mirrors by mirrored scenes, gloss by its share of even light."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.bilinear import sample
from omnisim.core.poses import pose
from omnisim.scene.model import Fog, Light, Lighting, LightKind, Material
from omnisim.scene.surface_kind import MAX_TRACED_ROUGHNESS
from omnisim.scene.surface_reflectance import environment_table
from tests.rendering.rays.test_caster import rays_from
from tests.scenes import room, room_color, room_hit, scene_of, square

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.shading.ray_optics import MAX_BOUNCES, LightPaths
from omnisim.rendering.stage import open_sensor
from omnisim.validation.reflective_rooms import camera, camera_pose, rooms

CHROME = Material(metallic=1.0, roughness=0.0, base_color=(1.0, 1.0, 1.0, 1.0))
WHITE = (1.0, 1.0, 1.0)
FLIP_Z = np.diag((1.0, 1.0, -1.0, 1.0))


def paths_of(count, key=1):
    numbers = np.arange(count, dtype=np.uint32)
    return LightPaths(np.zeros_like(numbers), numbers, np.ones(count, dtype=np.float32), key)


def traced(scene, rays, key=1, **options):
    return RayScene(scene).radiance(rays, paths=paths_of(len(rays.near_m), key), **options)


def down_from(origin, count=2000):
    """Rays below the horizon."""
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(count, 3))
    directions[:, 2] = -np.abs(directions[:, 2]) - 0.05
    return rays_from(origin, directions)


@pytest.mark.parametrize("fog", [None, Fog((0.5, 0.4, 0.2), (0.1, 0.2, 0.3))])
def test_a_mirror_shows_the_mirrored_scene_with_its_lamps_shadows_and_fog(fog):
    """Below a mirror of z = 0 stand the same boxes upside down, in the light along the mirror."""
    lamp = Light(LightKind.DIRECTIONAL, WHITE, 0.7, direction=np.array((0.6, -0.8, 0.0)))
    lighting = Lighting((0.2, 0.3, 0.25), (lamp,), fog=fog)
    boxes = [dataclasses.replace(room(), material=0)] * 2
    small = np.diag((0.2, 0.2, 0.3, 1.0))
    poses = [pose((1.0, 0.5, 0.9)) @ small, pose((2.2, -1.1, 0.7), yaw_deg=20.0) @ small]
    matte, sky = Material(double_sided=True), (0.1, 0.2, 0.5)
    mirror = square(half_m=1000.0, material=1)
    with_mirror = scene_of([*boxes, mirror], [matte, CHROME], [*poses, np.eye(4)], lighting, sky)
    twins = [*poses, *(FLIP_Z @ one for one in poses)]
    mirrored = scene_of([*boxes, *boxes], [matte], twins, lighting, sky)
    rays = down_from((-1.0, 0.3, 1.4))
    ours, expected = traced(with_mirror, rays), traced(mirrored, rays)
    assert np.mean(np.abs(ours - expected).max(axis=1) > 1e-3) < 5e-3  # edges
    assert len(np.unique(expected.round(3), axis=0)) > 100
    lit = RayScene(with_mirror).radiance(rays)  # today's: the sky alone
    assert np.mean(np.abs(lit - expected).max(axis=1) > 1e-2) > 0.1


def test_two_mirrors_at_a_right_angle_send_a_ray_back():
    """It meets the point of the wall that it would meet in the opposite direction."""
    walls = Material(unlit=True, double_sided=True)
    floor = square(half_m=0.5, z_m=0.0, material=1)
    turned = square(half_m=0.5, z_m=-0.5, material=1)
    poses = [np.eye(4), np.eye(4), pose((0.0, 0.0, 0.5), pitch_deg=-90.0)]
    scene = scene_of([room(), floor, turned], [walls, CHROME], poses)
    rays = rays_from((-0.4, 0.1, 0.35), [(0.55, 0.02, -0.3), (0.5, -0.1, -0.29)])
    scene_rays = RayScene(scene)
    hits = scene_rays.first_hits(rays)
    first = rays.origins_m + hits.ranges_m[:, None] * rays.directions
    assert (np.abs(first) < 0.51).all()  # on a mirror
    back = rays.directions * (-1.0, 1.0, -1.0)
    found = scene_rays.radiance(rays, paths=paths_of(2))
    # from the image of the origin in both mirrors
    expected = room_color(room_hit(np.array((1.4, 0.1, -0.35)), back))
    np.testing.assert_allclose(found, expected, atol=2e-4)


def test_mirrors_that_face_each_other_end():
    sides = [square(z_m=0.0), square(z_m=0.0)]
    opposite = pose((0.0, 0.0, 2.0), roll_deg=180.0)
    lighting = Lighting((0.25, 0.25, 0.25), ())
    scene = scene_of(sides, [CHROME], [np.eye(4), opposite], lighting)
    light = traced(scene, rays_from((0.0, 0.0, 1.0), [(0.0, 0.0, -1.0)]))
    # the last one reflects light from everywhere
    np.testing.assert_allclose(light, 0.25, rtol=0.01)
    assert MAX_BOUNCES == 6


@pytest.mark.parametrize(
    ("roughness", "degrees"), [(0.05, 10.0), (0.1, 80.0), (0.3, 60.0), (0.5, 10.0), (0.5, 80.0)]
)
def test_gloss_reflects_its_share_of_even_light(roughness, degrees):
    """By the table of a white environment, whose facets are sampled in another way."""
    metal = Material(metallic=1.0, roughness=roughness, base_color=(0.5, 0.5, 0.5, 1.0))
    scene = scene_of([square(half_m=1000.0)], [metal], None, Lighting((0, 0, 0), ()), WHITE)
    angle = np.radians(degrees)
    rays = rays_from(np.zeros(3) + (0, 0, 1), [(np.sin(angle), 0.0, -np.cos(angle))] * 500)
    table = environment_table()
    row, column = roughness * (len(table) - 1), np.cos(angle) * (table.shape[1] - 1)
    place = np.array([[column, row]])
    first, second = (sample(table[..., channel], place)[0] for channel in (0, 1))
    expected = 0.5 * first + second
    assert traced(scene, rays).mean() == pytest.approx(expected, abs=0.012)


def test_clear_coats_mirror_the_scene():
    black = Material(base_color=(0, 0, 0, 1), clearcoat=1.0)
    scene = scene_of([square(half_m=1000.0)], [black], None, Lighting((0, 0, 0), ()), WHITE)
    angle = np.radians(70.0)
    rays = rays_from((0, 0, 1), [(np.sin(angle), 0.0, -np.cos(angle))])
    schlick = 0.04 + 0.96 * (1.0 - np.cos(angle)) ** 5
    np.testing.assert_allclose(traced(scene, rays), schlick, rtol=1e-5)


def test_nothing_changes_where_no_material_is_smooth():
    rough = Material(metallic=0.5, roughness=MAX_TRACED_ROUGHNESS + 0.01, specular=1.0)
    for material in (rough, Material()):
        scene = scene_of([room(), square(material=0)], [dataclasses.replace(
            material, double_sided=True)], background=WHITE)  # fmt: skip
        rays = down_from((0.1, 0.2, 1.0))
        np.testing.assert_array_equal(traced(scene, rays), RayScene(scene).radiance(rays))


def test_noise_of_gloss_follows_from_the_seed_and_mirrors_have_none():
    scene = rooms()["floor of roughness 0.3"]
    small = camera(24, 1)

    def image(seed, frame_number=0, scene=scene):
        with open_sensor(scene, small, seed=seed, backend="rays") as renderer:
            frame = renderer.render(camera_pose(), frame_number=frame_number, also=("range",))
        return frame.rgb, frame.channels["range"]

    (one, ranges_m), (again, _), (other, _), (next_one, _) = (
        image(*of) for of in ((1,), (1,), (2,), (1, 1))
    )
    np.testing.assert_array_equal(one, again)
    assert np.mean(one != other) > 0.05
    assert np.mean(one != next_one) > 0.05
    mirror = rooms()["planar mirror"]
    first, second = image(1, scene=mirror), image(2, scene=mirror)
    np.testing.assert_array_equal(first[0], second[0])
    # ranges end at the surface: 1.3 m above the floor, along the rays
    bottom = ranges_m[-1, 11:13]
    np.testing.assert_allclose(
        bottom, 1.3 / np.sin(np.radians(8.0) + np.arctan(8.5 / 14.4)), rtol=0.01
    )


def test_hidden_parts_show_in_mirrors():
    """A camera does not see the housing around it, but a mirror does."""
    housing = scene_of([square(half_m=0.5)], [Material(unlit=True, double_sided=True)])
    scene = RayScene(scene_of([square(half_m=100.0)], [CHROME]), [housing])
    objects = ObjectState([pose((0.0, 0.0, 2.0))], frozenset({(0, 0)}))
    straight = rays_from((0.0, 0.0, 3.0), [(0.0, 0.0, -1.0)])
    np.testing.assert_allclose(
        scene.radiance(straight, objects=objects, paths=paths_of(1)), [WHITE], rtol=1e-6
    )
