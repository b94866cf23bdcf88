"""Radiance and hits along rays through glass and holes, by formulas; and textures' footprints."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from omnisim import Scene
from omnisim.cameras import EquidistantCamera, PerspectiveCamera, Rays, pixel_grid
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import CameraSetup, ScenePoses
from omnisim.rendering.pixel_rays import PixelRays
from omnisim.rendering.rays.caster import DepthLimits
from omnisim.rendering.rays.ray_backend import RayHitSource, RayImage
from omnisim.rendering.rays.ray_scene import MAX_LAYERS, ObjectState, RayScene
from omnisim.rendering.rays.scene_rays import whole_areas_px
from omnisim.scene.model import AlphaMode, Light, Lighting, LightKind, Material, Texture
from tests.rendering.rays.test_caster import rays_from
from tests.scenes import room, room_color, room_hit, scene_of, square

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

DOWN = rays_from((0.5, 0.2, 4.5), [[0.0, 0.0, -1.0]])
SKY = (0.1, 0.2, 0.3)


def glass(color, alpha):
    return Material(base_color=(*color, alpha), alpha_mode=AlphaMode.BLEND)


@pytest.mark.parametrize("offset_m", [0.0, 3e5])
def test_light_comes_through_glass_in_its_order(offset_m):
    """Whatever the order of the instances, a millimeter apart, and far from the world's origin."""
    panes = {4.0: ((1.0, 0.0, 0.0), 0.25), 3.999: ((0.0, 1.0, 0.0), 0.5), 2.0: ((0.0, 0.0, 1), 1)}
    order = [2.0, 4.0, 3.999]
    scene = scene_of(
        [square(z_m=height, material=number) for number, height in enumerate(order)],
        [glass(*panes[height]) for height in order],
        [pose((offset_m, offset_m, 0.0))] * 3,
        background=SKY,
    )
    down = DOWN._replace(origins_m=DOWN.origins_m + (offset_m, offset_m, 0.0))
    expected = np.array([0.25, 0.75 * 0.5, 0.75 * 0.5])
    np.testing.assert_allclose(RayScene(scene).radiance(down)[0], expected, rtol=1e-6)
    up = down._replace(directions=-down.directions)
    np.testing.assert_allclose(RayScene(scene).radiance(up)[0], SKY, rtol=1e-6)
    found = RayScene(scene).first_hits(down)
    np.testing.assert_allclose(found.ranges_m, [0.501], rtol=1e-6)  # clearer than half: no hit


def test_a_ray_along_the_edge_of_two_triangles_passes_one_of_them():
    """Twenty thousand rays at the diagonal of a tilted pane: none is dimmed twice."""
    tilted = pose((0.0, 0.0, 0.0), roll_deg=20.0, pitch_deg=13.0)
    scene = scene_of([square()], [glass((1.0, 1.0, 1.0), 0.5)], [tilted])
    along = np.linspace(-4.9, 4.9, 20000)
    points = np.stack((along, along, np.zeros_like(along)), axis=1) @ tilted[:3, :3].T
    origin = np.array([0.3, -0.2, 5.0])
    lights = RayScene(scene).radiance(rays_from(origin, points - origin))
    np.testing.assert_array_equal(lights, np.float32(0.5))


def test_holes_show_what_is_behind_them():
    pixels = np.full((2, 2, 4), 255, dtype=np.uint8)
    pixels[:, 1] = (0, 0, 0, 0)  # to the right a hole
    coordinates = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    fence = Material(texture=Texture(pixels), alpha_mode=AlphaMode.MASK, base_color=(1, 0, 0, 1))
    scene = scene_of(
        [square(z_m=1.0, texture_coordinates=coordinates), square(z_m=0.0, material=1)],
        [fence, Material(base_color=(0, 1, 0, 1))],
        background=SKY,
    )
    rays = rays_from([[-2.5, 0.0, 3.0], [2.5, 0.0, 3.0], [9.0, 0.0, 3.0]], [[0.0, 0.0, -1.0]] * 3)
    lights = RayScene(scene).radiance(rays)
    np.testing.assert_allclose(lights, [[1, 0, 0], [0, 1, 0], SKY], atol=1e-6)
    found = RayScene(scene).first_hits(rays)
    np.testing.assert_allclose(found.ranges_m, [2.0, 3.0, np.inf], rtol=1e-6)


def test_a_ray_ends_after_many_layers():
    layers = [square(z_m=-0.01 * number) for number in range(MAX_LAYERS + 40)]
    scene = scene_of(layers, [glass((1.0, 1.0, 1.0), 0.0)], background=SKY)
    assert np.isfinite(RayScene(scene).radiance(DOWN)[0]).all()


def test_lamps_light_what_they_reach():
    """Lambert's cosine, the inverse square, the range's window, the cone; both sides of a sheet."""
    lamps = (
        Light(LightKind.POINT, (1.0, 0.5, 0.25), 8.0, position_m=np.array([0.5, 0.2, 2.0])),
        Light(LightKind.DIRECTIONAL, (0.0, 0.0, 1.0), 0.5, direction=np.array([0.6, 0.0, -0.8])),
        Light(
            LightKind.SPOT, (1.0, 1.0, 1.0), 100.0, position_m=np.array([0.5, 3.2, 4.0]),
            cone_cosines=(0.99, 0.9),
        ),
    )  # fmt: skip
    lighting = Lighting((0.01, 0.02, 0.03), lamps, exposure=0.1)
    scene = scene_of([square()], [Material(double_sided=True)], lighting=lighting)
    above = RayScene(scene).radiance(DOWN)[0]
    cosine = 4.0 / 5.0  # of the spot's axis and the ray from it
    assert cosine < 0.9  # it does not reach
    expected = np.array([0.01, 0.02, 0.03]) + 0.1 * np.array([2.0, 1.0, 0.5])
    expected[2] += 0.1 * 0.5 * 0.8
    np.testing.assert_allclose(above, expected, rtol=1e-5)
    up = rays_from((0.5, 0.2, -3.0), [[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(RayScene(scene).radiance(up)[0], lighting.ambient, rtol=1e-6)
    np.testing.assert_allclose(RayScene(scene).radiance(DOWN, unlit=True), [[1, 1, 1]])
    with_range = Light(
        LightKind.POINT, (1, 1, 1), 8.0, position_m=np.array([0.5, 0.2, 2.0]), range_m=3.0
    )
    scene = scene_of([square()], lighting=Lighting((0.0, 0.0, 0.0), (with_range,)))
    window = 1.0 - (2.0 / 3.0) ** 4
    np.testing.assert_allclose(RayScene(scene).radiance(DOWN)[0], 2.0 * window, rtol=1e-5)


@pytest.mark.parametrize("tilt", [0.0, 0.8])
def test_far_textures_are_averaged_over_the_footprint(tilt):
    """A fine chessboard is gray from afar, and black and white from near by."""
    board = (np.indices((512, 512)).sum(axis=0) % 2 * 255).astype(np.uint8)
    pixels = np.dstack((board, board, board, np.full_like(board, 255)))
    coordinates = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    scene = RayScene(
        scene_of(
            [square(texture_coordinates=coordinates)],
            [Material(texture=Texture(pixels), double_sided=True)],
        )
    )
    directions = np.array([[tilt + 0.0001 * step, 0.0, -1.0] for step in range(200)])
    rays = rays_from((0.0, 0.5 * 10.0 / 512, 3.0), directions)  # along a row of texels
    wide, narrow = (
        np.broadcast_to(
            np.array([[step, 0.0, 0.0], [0.0, step, 0.0]], dtype=np.float32), (200, 2, 3)
        )
        for step in (0.05, 1e-6)
    )
    np.testing.assert_allclose(scene.radiance(rays, wide), 0.5, atol=0.01)
    assert np.ptp(scene.radiance(rays, narrow)) > 0.9


def test_objects_take_their_normals_and_holes_along():
    """A sheet that stands up is lit from the side."""
    side = Light(LightKind.DIRECTIONAL, (1.0, 1.0, 1.0), 1.0, direction=np.array([-1.0, 0.0, 0.0]))
    lighting = Lighting((0.0, 0.0, 0.0), (side,))
    far = scene_of([square(z_m=-9.0)], lighting=lighting)
    normals = np.tile(np.array([[0.0, 0.0, 1.0]], dtype=np.float32), (4, 1))
    sheet = scene_of([square(1.0, normals=normals)], [Material()])
    scene = RayScene(far, [sheet])
    standing = np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]], dtype=float)
    rays = rays_from((3.0, 0.1, 0.1), [[-1.0, 0.0, 0.0]])
    objects = ObjectState((standing,))
    np.testing.assert_allclose(scene.radiance(rays, objects=objects), [[1.0, 1.0, 1.0]], rtol=1e-6)
    hits = scene.first_hits(rays, objects)
    np.testing.assert_allclose(
        scene.shading.normals(hits, objects.world_from_objects), [[1.0, 0.0, 0.0]], atol=1e-6
    )


@dataclass(frozen=True)
class AxialCamera(EquidistantCamera):
    """Rays that start along the axis: the farther from it they look, the higher."""

    def ray_from_pixel(self, pixels_px):
        """As the lens, from 0 to 0.4 m along the axis."""
        rays = super().ray_from_pixel(pixels_px)
        heights_m = 0.4 * (1.0 - rays.directions[..., 2]) / 2.0
        return Rays(rays.directions, rays.valid, heights_m[..., None] * np.array([0.0, 0.0, 1.0]))


def test_each_ray_starts_at_its_own_origin():
    camera = AxialCamera(40, 30, 12.0, (19.5, 14.5), math.radians(100.0))
    scene, world_from_rig = (
        RayScene(scene_of([room()])),
        pose((0.3, -0.2, 0.1), roll_deg=3.0, pitch_deg=-8.0, yaw_deg=40.0),
    )
    limits, still = DepthLimits(0.01, math.inf), ObjectState()
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical
    origins = rays.origins_m[rays.valid] @ world_from_optical.T + world_from_rig[:3, 3]
    directions = rays.directions[rays.valid] @ world_from_optical.T
    assert np.ptp(rays.origins_m[..., 2]) > 0.15
    expected = room_hit(origins, directions)
    sensor = OmniCamera(camera, near_m=limits.near_m, far_m=limits.far_m)
    hits = RayHitSource(scene, CameraSetup(sensor)).hits(ScenePoses(world_from_rig))
    points = hits.points_m[rays.valid] + world_from_rig[:3, 3]
    np.testing.assert_allclose(points, expected, atol=1e-6)
    lengths_m = np.linalg.norm(expected - origins, axis=1)
    np.testing.assert_allclose(hits.ranges_m[rays.valid], lengths_m, rtol=1e-6)
    image = RayImage(scene, camera, None, 1, limits).render(world_from_rig, still)
    np.testing.assert_allclose(image[rays.valid, :3], room_color(expected), atol=1e-5)


CAMERA = PerspectiveCamera(100, 80, 52.0, (49.5, 39.5))


def _plate(name, x_m, right_m, left_m):
    """Plate across the optical axis, 2 m high: its edges are between pixels."""
    corners = [(x_m, y, z) for y, z in ((right_m, -1), (left_m, -1), (left_m, 1), (right_m, 1))]
    return Scene.from_arrays(name, corners, [(0, 1, 2), (0, 2, 3)])


def test_hidden_pixels_count_but_those_out_of_the_image_do_not():
    scene = _plate("behind", 4.0, -1.0, 1.0)
    scene = scene.added("before", _plate("before", 2.0, 0.0, 1.0))
    scene = scene.added("beside", _plate("beside", 4.0, 3.0, 5.0))
    rays = RayScene(scene)
    names = [surface.name for surface in rays.caster.geometry.surfaces]
    ids = {"behind": 1, "before": 2, "beside": 3}
    found = whole_areas_px(
        rays,
        PixelRays(CAMERA, None),
        DepthLimits(0.05, np.inf),
        np.eye(4),
        ObjectState(),
        np.array([ids[name] for name in names]),
        np.zeros((80, 100), dtype=np.uint32),
    )
    # 52 px × 1 m/4 m to either side; beside, from 39 px on, of which 50 px are in the image
    assert found.tolist() == [0, 26 * 26, 26 * 52, 11 * 26]
