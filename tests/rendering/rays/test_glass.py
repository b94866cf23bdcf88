"""Thick glass by rays: Snell's law, total reflection, Fresnel's shares and attenuation."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.scene.model import Lighting, Material, Mesh
from omnisim.validation.material_chart import sphere
from tests.rendering.rays.test_caster import rays_from
from tests.rendering.rays.test_panes import ABOVE, BELOW, reflected_by_pane, slope
from tests.rendering.rays.test_reflections import paths_of, traced
from tests.scenes import room, room_color, room_hit, scene_of, square

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.rendering.rays import ray_scene
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.scene_rays import cast_through

DARK = Lighting((0.0, 0.0, 0.0), ())
GLASS = Material(
    base_color=(1.0, 1.0, 1.0, 1.0), roughness=0.0, specular=1.0, transmission=1.0, thickness_m=1.0
)
SHINING = Material(unlit=True, double_sided=True)


def ball_of_tangents(points):
    """Body of a unit ball's tangent planes at points (n, 3), each a large triangle."""
    corners, triangles, normals = [], [], []
    for number, normal in enumerate(points):
        side = np.cross(normal, (0.3, -0.5, 0.81))
        side /= np.linalg.norm(side)
        up = np.cross(normal, side)
        angles = np.radians((0.0, 120.0, 240.0))[:, None]
        corners.append(normal + 0.2 * (np.cos(angles) * side + np.sin(angles) * up))
        triangles.append(3 * number + np.arange(3))
        normals.append(np.tile(normal, (3, 1)))
    return Mesh(
        "ball",
        np.concatenate(corners).astype(np.float32),
        np.array(triangles, dtype=np.uint32),
        0,
        normals=np.concatenate(normals).astype(np.float32),
    )


def snell(offset, ior):
    """Points and directions, in the plane of x and z, of a ray along −z through a unit ball."""
    outside = np.arcsin(offset)
    inside = np.arcsin(offset / ior)
    entry = np.array((offset, 0.0, np.sqrt(1.0 - offset**2)))
    # inside, the ray sees the center under `inside` at both ends: it turns by their sum
    turned = np.pi - 2.0 * inside
    azimuth = np.arctan2(entry[0], entry[2]) + turned
    leaving = np.array((np.sin(azimuth), 0.0, np.cos(azimuth)))
    deviation = 2.0 * (outside - inside)
    return entry, leaving, np.array((-np.sin(deviation), 0.0, -np.cos(deviation)))


def exit_directions(scene, rays, monkeypatch, **paths):
    """Directions of the rays that leave a scene, and the light that they would see."""
    seen = []
    monkeypatch.setattr(
        ray_scene, "_sky", lambda _, directions, *__: seen.append(directions) or np.ones((1, 3))
    )
    lit = dataclasses.replace(scene, lighting=Lighting((0.0,) * 3, (), environment=object()))
    lit_scene = RayScene(scene)
    lit_scene.scene = lit
    lit_scene.radiance(rays, paths=paths_of(len(rays.near_m))._replace(**paths))
    return np.concatenate(seen)


@pytest.mark.parametrize("ior", [1.33, 2.4])
@pytest.mark.parametrize("offset", [0.01, 0.7, 0.95])
def test_a_ray_leaves_a_ball_as_snell_says(ior, offset, monkeypatch):
    entry, leaving, expected = snell(offset, ior)
    ball = scene_of(
        [ball_of_tangents((entry, leaving))], [dataclasses.replace(GLASS, ior=ior)], None, DARK
    )
    rays = rays_from((offset, 0.0, 3.0), [(0.0, 0.0, -1.0)])
    directions = exit_directions(ball, rays, monkeypatch)
    off = np.linalg.norm(directions - expected, axis=1)
    assert off.min() < 1e-6


def test_a_fine_mesh_of_a_ball_refracts_as_the_ball(monkeypatch):
    """With interpolated normals; triangles of 2.8° are off by their sagitta."""
    ball = scene_of([sphere(1.0, 64)], [GLASS], None, DARK)
    offsets = np.array((0.2, 0.6, 0.9))
    rays = rays_from([(offset, 0.0, 3.0) for offset in offsets], [(0.0, 0.0, -1.0)] * 3)
    directions = exit_directions(ball, rays, monkeypatch)
    for offset in offsets:
        expected = snell(offset, 1.5)[2]
        assert np.linalg.norm(directions - expected, axis=1).min() < 4e-3


def fresnel(degrees, ior):
    """Reflectance of one interface from air, by Fresnel's sines and tangents."""
    outside = np.radians(max(degrees, 1e-3))
    inside = np.arcsin(np.sin(outside) / ior)
    across = (np.sin(outside - inside) / np.sin(outside + inside)) ** 2
    along = (np.tan(outside - inside) / np.tan(outside + inside)) ** 2
    return 0.5 * (across + along)


def slab(thickness_m=0.5, **values):
    """Slab of glass between z = 0 and below, a light above it and one below it."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 50.0
    top = np.column_stack((corners, np.zeros(4)))
    positions = np.concatenate((top, (top - (0.0, 0.0, thickness_m))[::-1]))
    triangles = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)], dtype=np.uint32)
    glass = Mesh("slab", positions.astype(np.float32), triangles, 2)
    lights = [dataclasses.replace(SHINING, base_color=(*color, 1.0)) for color in (ABOVE, BELOW)]
    meshes = [square(half_m=1e4, z_m=3.0), square(half_m=1e4, z_m=-3.0, material=1), glass]
    materials = [*lights, dataclasses.replace(GLASS, **values)]
    return scene_of(meshes, materials, None, DARK)


@pytest.mark.parametrize("degrees", [0.0, 40.0, 75.0])
def test_a_slab_reflects_as_the_thin_pane_of_the_same_glass(degrees):
    share = reflected_by_pane(degrees, 1.5)
    light = traced(slab(), slope(degrees))
    # reflections below 1/512 are left out
    np.testing.assert_allclose(light[0], share * ABOVE + (1 - share) * BELOW, atol=4e-3)


@pytest.mark.parametrize("degrees", [0.0, 60.0])
def test_glass_attenuates_light_by_the_length_of_its_path_and_tints_it_at_each_surface(degrees):
    tint, color = np.array((0.9, 0.8, 0.7)), np.array((0.5, 0.25, 1.0))
    scene = slab(
        thickness_m=0.6, attenuation_color=tuple(color), attenuation_distance_m=0.2,
        base_color=(*tint, 1.0), transmission=0.9,
    )  # fmt: skip
    inside = np.arcsin(np.sin(np.radians(degrees)) / 1.5)
    once = 1.0 - fresnel(degrees, 1.5)
    left = color ** (0.6 / np.cos(inside) / 0.2)
    straight = (once * 0.9 * tint) ** 2 * left * BELOW
    mirrored = fresnel(degrees, 1.5) * ABOVE
    # light that is reflected within the glass has at least twice the path there
    within = fresnel(degrees, 1.5) * (once * 0.9 * tint) ** 2 * left**2 * ABOVE
    light = traced(scene, slope(degrees))
    np.testing.assert_allclose(light[0], straight + mirrored + within, atol=5e-4)


def test_a_ray_may_start_in_glass_and_is_reflected_within_it():
    color = np.array((0.5, 0.25, 1.0))
    scene = slab(thickness_m=0.6, attenuation_color=tuple(color), attenuation_distance_m=1.0)
    light = traced(scene, rays_from((0.0, 0.0, -0.2), [(0.0, 0.0, 1.0)]))
    once = fresnel(0.0, 1.5)
    up, down = (1.0 - once) * color**0.2 * ABOVE, (1.0 - once) * color**0.8 * BELOW
    # the second reflection is below 1/512
    np.testing.assert_allclose(light[0], up + once * down, atol=1e-6)


def test_light_beyond_the_critical_angle_is_totally_reflected():
    """A ray enters a leg of a prism perpendicularly, and is turned to the other leg at 45°."""
    corners = np.array([(0.0, -0.5), (1.0, -0.5), (0.0, 0.5)])  # in x and z
    near, far = (np.insert(corners, 1, y, axis=1) for y in (-1.0, 1.0))
    sides = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        sides += [(near[i], far[i], far[j]), (near[i], far[j], near[j])]
    positions = np.array(sides).reshape(-1, 3)
    edges = positions[1:3] - positions[0]
    assert np.cross(*edges)[2] < 0.0  # the front of the first leg, below, is outside
    triangles = np.arange(len(positions), dtype=np.uint32).reshape(-1, 3)
    prism = Mesh("prism", positions.astype(np.float32), triangles, 1)
    scene = scene_of([dataclasses.replace(room(), material=0), prism], [SHINING, GLASS], None, DARK)
    start = np.array((0.6, 0.1, -1.2))
    light = traced(scene, rays_from(start, [(0.0, 0.0, 1.0)]))
    floor = room_color(room_hit(start, np.array((0.0, 0.0, -1.0))))
    wall = room_color(room_hit(np.array((0.0, 0.1, -0.1)), np.array((-1.0, 0.0, 0.0))))
    once = 1.0 - fresnel(0.0, 1.5)
    expected = (1.0 - once) * floor + once**2 * (wall + (1.0 - once) * floor)
    np.testing.assert_allclose(light[0], expected, atol=2e-3)  # two reflections within: 0.16 %


def test_dispersive_glass_bends_blue_more_than_red(monkeypatch):
    """Indices of red and blue by KHR_materials_dispersion, at an Abbe number of 20 / 4."""
    glass = dataclasses.replace(GLASS, dispersion=4.0)
    rays = rays_from((0.6, 0.0, 3.0), [(0.0, 0.0, -1.0)])
    for channel, ior in enumerate((1.45, 1.5, 1.55)):
        entry, leaving, expected = snell(0.6, ior)
        ball = scene_of([ball_of_tangents((entry, leaving))], [glass], None, DARK)
        directions = exit_directions(ball, rays, monkeypatch, channel=channel)
        assert np.linalg.norm(directions - expected, axis=1).min() < 1e-6


def test_each_channel_is_seen_through_glass_of_its_own_index():
    walls, ball = (
        dataclasses.replace(mesh, material=number)
        for number, mesh in enumerate((room(), sphere(0.5, 32)))
    )
    rays = rays_from((-1.5, 0.2, 0.1), [(1.0, -0.1, 0.05)])
    lights = [
        traced(
            scene_of([walls, ball], [SHINING, dataclasses.replace(GLASS, **values)], None, DARK),
            rays,
        )[0]
        for values in (
            {"ior": 1.5, "dispersion": 4.0}, {"ior": 1.45}, {"ior": 1.5}, {"ior": 1.55},
        )
    ]  # fmt: skip
    np.testing.assert_allclose(lights[0], np.diagonal(lights[1:]), atol=1e-6)
    assert np.ptp(lights[1:], axis=0).max() > 1e-2


def in_room(ball, material=GLASS, objects=(), objects_at=()):
    """Light of rays at a room with a ball of glass, or with dynamic objects."""
    walls = dataclasses.replace(room(), material=0)
    meshes = [walls] if ball is None else [walls, dataclasses.replace(ball, material=1)]
    scene = scene_of(meshes, [SHINING, material], None, DARK)
    directions = np.random.default_rng(3).normal((2.0, 0.0, 0.0), 0.4, (60, 3))
    rays = rays_from((-2.0, 0.1, 0.2), directions)
    return RayScene(scene, objects).radiance(
        rays, objects=ObjectState(objects_at), paths=paths_of(60)
    )


def test_sides_mirroring_and_motion_change_nothing():
    ball = sphere(0.8, 24)
    expected = in_room(ball)
    assert np.abs(expected - in_room(None)).max() > 0.1
    double = in_room(ball, dataclasses.replace(GLASS, double_sided=True))
    np.testing.assert_array_equal(double, expected)
    moved = pose((0.3, -0.2, 0.1), yaw_deg=165.0)
    for flip, most in ((1.0, 1e-4), (-1.0, 0.02)):  # quads are mirrored, but not their diagonals
        part = scene_of([ball], [GLASS], [np.linalg.inv(moved) @ np.diag((1.0, 1.0, flip, 1.0))])
        light = in_room(None, objects=[part], objects_at=[moved])
        assert np.mean(np.abs(light - expected) > most) < 0.05


def test_an_open_mesh_fills_the_space_behind_it():
    color = np.array((0.5, 0.25, 1.0))
    glass = dataclasses.replace(GLASS, attenuation_color=tuple(color), attenuation_distance_m=2.0)
    floor = dataclasses.replace(SHINING, base_color=(*BELOW, 1.0))
    once = 1.0 - fresnel(40.0, 1.5)
    length_m = 3.0 / np.cos(np.arcsin(np.sin(np.radians(40.0)) / 1.5))
    for sky in ((0.0, 0.0, 0.0), (0.3, 0.6, 0.9)):
        sheet = square(half_m=1e3, material=1)
        above = traced(
            scene_of([square(half_m=1e3, z_m=-3.0), sheet], [floor, glass], None, DARK, sky),
            slope(40.0),
        )
        through = once * color ** (length_m / 2.0) * BELOW
        np.testing.assert_allclose(above[0], through + (1.0 - once) * np.array(sky), atol=1e-4)
    alone = traced(scene_of([sheet], [SHINING, glass], None, DARK, sky), slope(40.0))
    expected = np.where(color < 1.0, 0.0, once) * sky + (1.0 - once) * np.array(sky)
    np.testing.assert_allclose(alone[0], expected, atol=1e-4)


def test_ranges_through_panes_end_at_thick_glass():
    scene = RayScene(slab())
    ends = cast_through(scene, slope(20.0), ObjectState(), np.zeros((1, 2, 3), dtype=np.float32))
    np.testing.assert_allclose(ends.ranges_m, 1.0 / np.cos(np.radians(20.0)), rtol=1e-6)
    assert ends.surfaces_plus_one == 3
