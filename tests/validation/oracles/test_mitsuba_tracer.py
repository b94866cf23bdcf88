"""Mitsuba's rays, reflected by a mesh of metal, against ours, which know no mesh.

In small scenes, whose every color is known.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from omnisim.cameras import HyperbolicCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.errors import SceneError
from omnisim.core.poses import pose
from omnisim.core.srgb import linear_from_srgb
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.scene.model import Material, Mesh, Texture, Wrap
from omnisim.validation.image_differences import psnr_db
from tests.scenes import room, room_color, room_hit, scene_of

mi = pytest.importorskip("mitsuba", reason="Mitsuba is an optional oracle")
from omnisim.validation.oracles import mitsuba_optics, mitsuba_scene  # noqa: E402

SIZE_PX = 128
AVERAGED = 4
LOOKING_UP = np.eye(4)
LOOKING_UP[:3, :3] = RIG_FROM_OPTICAL_LOOKING_UP


def _camera(size_px=SIZE_PX):
    return OmniCamera().resized(size_px).model


def _inside(camera):
    """Pixels (height, width) well inside the rim."""
    v, u = np.indices((camera.height_px, camera.width_px))
    center_u, center_v = camera.principal_point_px
    return np.hypot(u - center_u, v - center_v) < camera.rim_radius_px - 2.0


def _expected(camera, world_from_optical, color_of_rays):
    """Averages over each pixel of what our rays see."""
    steps = (np.arange(AVERAGED) + 0.5) / AVERAGED - 0.5
    v, u = np.indices((camera.height_px, camera.width_px), dtype=float)
    total = 0.0
    for right in steps:
        for down in steps:
            rays = camera.ray_from_pixel(np.stack((u + right, v + down), axis=-1)).directions
            total = total + color_of_rays(rays @ world_from_optical[:3, :3].T)
    return total / AVERAGED**2


@pytest.mark.slow
@pytest.mark.parametrize(
    "world_from_optical",
    [
        pose((0.4, -0.3, 0.2), yaw_deg=35.0) @ LOOKING_UP,
        pose((-0.5, 0.6, -0.2), roll_deg=25.0, pitch_deg=-130.0, yaw_deg=70.0),
    ],
    ids=["turned", "any way"],
)
def test_room_of_gradients(world_from_optical):
    """Each channel is a different axis of the room: no turn and no mirroring looks the same."""
    camera = dataclasses.replace(
        _camera(), width_px=150, height_px=136, principal_point_px=(70.25, 71.5)
    )
    traced = mitsuba_optics.trace_mirror(scene_of([room()]), camera, world_from_optical, 36)
    origin = world_from_optical[:3, 3]
    ours = _expected(camera, world_from_optical, lambda rays: room_color(room_hit(origin, rays)))
    difference = np.abs(traced - ours)[_inside(camera)]
    assert difference.mean() < 0.01 / 255.0
    # Now and then a ray slips through the mirror between two facets and sees the opposite wall.
    assert (difference.max(axis=-1) > 1.0 / 255.0).mean() < 0.005
    assert difference.max() < 0.05


def _bilinear(pixels, coordinates, wrap):
    """Linear RGB (..., 3) of a texture at coordinates (..., 2), (0, 0) at its top left."""
    mode = "grid-wrap" if wrap is Wrap.REPEAT else "nearest"
    at = np.moveaxis((coordinates * pixels.shape[1::-1] - 0.5)[..., ::-1], -1, 0)
    channels = np.moveaxis(linear_from_srgb(pixels[..., :3] / 255.0), -1, 0)
    return np.stack(
        [map_coordinates(channel, at, order=1, mode=mode) for channel in channels], axis=-1
    )


@pytest.mark.parametrize("wrap", list(Wrap))
def test_textured_quad(wrap):
    """A floor whose texture coordinates run from −1 to 2: three tiles, or one and its edges."""
    pixels = np.random.default_rng(0).integers(0, 256, (3, 4, 4), dtype=np.uint8)
    factor = (0.9, 0.6, 0.3, 1.0)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    floor = Mesh(
        "floor",
        np.column_stack((3.0 * corners, np.zeros(4))).astype(np.float32),
        np.array([(0, 1, 2), (0, 2, 3)], dtype=np.uint32),
        0,
        texture_coordinates=(0.5 + 1.5 * corners * (1, -1)).astype(np.float32),
    )
    sky = (0.1, 0.2, 0.4)
    scene = scene_of(
        [floor], [Material(base_color=factor, texture=Texture(pixels, wrap, wrap))], background=sky
    )
    camera, height_m = _camera(), 0.8

    def color_of_rays(rays):
        distance = height_m / np.maximum(-rays[..., 2:], 1e-6)
        hit = distance * rays[..., :2]
        inside = np.all(np.abs(hit) <= 3.0, axis=-1, keepdims=True)
        coordinates = 0.5 + 0.5 * np.clip(hit, -3.0, 3.0) * (1, -1)
        return np.where(inside, _bilinear(pixels, coordinates, wrap) * factor[:3], sky)

    world_from_optical = pose((0.0, 0.0, height_m)) @ LOOKING_UP
    traced = mitsuba_optics.trace_mirror(scene, camera, world_from_optical, 16)
    ours = _expected(camera, world_from_optical, color_of_rays)
    # The floor's edge is sampled by both, coarsely.
    assert psnr_db(traced, ours, _inside(camera)) > 40.0
    assert np.median(np.abs(traced - ours)[_inside(camera)]) < 0.2 / 255.0


def test_unsupported_materials_are_refused():
    texture = Texture(np.zeros((1, 1, 4), dtype=np.uint8), Wrap.REPEAT, Wrap.CLAMP_TO_EDGE)
    coordinates = np.zeros((8, 2), dtype=np.float32)
    mesh = dataclasses.replace(room(), texture_coordinates=coordinates)
    textured = Material("rug", texture=texture, double_sided=True)
    with pytest.raises(SceneError, match="'rug': Mitsuba has no texture times vertex colors"):
        mitsuba_optics.trace_mirror(scene_of([mesh], [textured]), _camera(), LOOKING_UP, 1)
    mesh = dataclasses.replace(mesh, colors=None)
    with pytest.raises(SceneError, match="'rug': Mitsuba wraps u and v"):
        mitsuba_optics.trace_mirror(scene_of([mesh], [textured]), _camera(), LOOKING_UP, 1)


@pytest.mark.slow
def test_seeds_and_variant():
    scene, camera = scene_of([room()]), _camera(16)
    mi.set_variant("scalar_spectral")
    first, again, other = (
        mitsuba_optics.trace_mirror(scene, camera, LOOKING_UP, 4, seed) for seed in (0, 0, 1)
    )
    assert mi.variant() == "scalar_spectral"
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def _reflected(camera, pixels, distance_m):
    """Points of Mitsuba's rays at `distance_m`, optical frame, meters."""
    mi.set_variant(mitsuba_scene.VARIANT)
    units_per_m = mitsuba_optics.RIM_UNITS / camera.mirror.rim_radius_m
    sensor = mi.load_dict(mitsuba_optics.mirror_pinhole(camera, np.eye(3), units_per_m, 1))
    mirror = mitsuba_optics.mirror_of_metal(camera.mirror, np.eye(3), units_per_m)
    scene = mi.load_dict({"type": "scene", "mirror": mirror})
    places = []
    for on_film in (pixels + 0.5) / (camera.width_px, camera.height_px):
        ray, _ = sensor.sample_ray(0.0, 0.5, mi.ScalarPoint2f(on_film), mi.ScalarPoint2f(0.5))
        hit = scene.ray_intersect(ray)
        assert hit.is_valid()
        reflected = hit.spawn_ray(hit.to_world(mi.reflect(hit.wi)))
        start_m = np.array(reflected.o, dtype=float) / units_per_m
        places.append(start_m + distance_m * np.array(reflected.d, dtype=float))
    return np.array(places)


def test_rays_as_traced():
    """The numbers in `trace_mirror`, and that a ray 0.1 mm beside the mirror would not do."""
    camera = _camera(512)
    random = np.random.default_rng(0)
    radius = (camera.rim_radius_px - 0.5) * np.sqrt(random.random(2000))
    azimuth = 2.0 * math.pi * random.random(2000)
    pixels = np.stack((radius * np.cos(azimuth), radius * np.sin(azimuth)), axis=-1)
    pixels += camera.principal_point_px
    errors_px = camera.pixel_from_ray(_reflected(camera, pixels, 1.0)).positions_px - pixels
    lengths_px = np.linalg.norm(errors_px, axis=-1)
    assert lengths_px.mean() < 0.0008
    assert lengths_px.max() < 0.002
    assert np.abs(errors_px.mean(axis=0)).max() < 0.0002  # nor is the image displaced


def test_facets_cover_the_mirror_and_are_fine_enough():
    mirror, sectors = HyperbolicMirror(), mitsuba_scene.SECTORS
    vertices_m, triangles = mitsuba_optics.mirror_mesh(mirror)
    corners_m = vertices_m[triangles]
    areas_m2 = 0.5 * np.linalg.det(np.diff(corners_m[..., :2], axis=1))  # along the axis
    assert areas_m2.min() > 0.0
    polygon = 0.5 * sectors * math.sin(2.0 * math.pi / sectors)
    assert areas_m2.sum() == pytest.approx(polygon * mirror.rim_radius_m**2)
    x_m, y_m, z_m = corners_m.mean(axis=1).T
    below_m = mirror.height_from_radius_m(np.hypot(x_m, y_m)) - z_m
    # 0.003 px where the rim has a radius of 256 px
    assert np.abs(below_m).max() < 1e-5 * mirror.rim_radius_m


@pytest.mark.slow
def test_other_mirrors():
    """A wide rim, and the plane mirror, which Eq. 1 has as its limit."""
    for k, rim_deg in ((3.5, 100.0), (2.0, 60.0)):
        mirror = HyperbolicMirror(
            k=k, c=1.0, meters_per_unit=0.1, theta_max_rad=math.radians(rim_deg)
        )
        camera = HyperbolicCamera.framed_on_rim(mirror, 64, 64)
        traced = mitsuba_optics.trace_mirror(scene_of([room()]), camera, LOOKING_UP, 16)
        ours = _expected(camera, LOOKING_UP, lambda rays: room_color(room_hit(np.zeros(3), rays)))
        assert np.abs(traced - ours)[_inside(camera)].mean() < 0.05 / 255.0
