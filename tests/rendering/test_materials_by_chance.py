"""Materials and lamps by chance: matte rooms and single glossy bodies, by cube and by rays.

Each scene follows from its number. Away from edges a pixel of the cube lies within what rays have
in the pixel and its neighbors.
"""

import dataclasses

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from omnisim import OmniCamera
from omnisim.cameras import PerspectiveCamera
from omnisim.core.poses import pose
from omnisim.scene.light.environment import Environment, map_directions
from omnisim.scene.model import Light, Lighting, LightKind, Material, Mesh, Texture
from omnisim.scene.parts import Wrap
from omnisim.validation.material_chart import sphere
from omnisim.validation.traced_light import fisheye
from tests.rendering.frames import by_both
from tests.scenes import scene_of
from tests.slow import slow_but
from tests.vehicles import box, scaled

pytestmark = pytest.mark.usefixtures("needs_opengl")
pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

WIDTH_PX = 64
STEPS = 4  # of 255: beyond what rays have
MAX_SHARE, MIN_AGREEING = 0.004, 0.96  # of pixels, and of scenes
ROOM_HALF_M = np.array((3.0, 2.5, 1.5))


def scene_by_chance(number):
    """Scene and the camera's pose: of even numbers a matte room, of odd ones a glossy body."""
    rng = np.random.default_rng((7, number))
    return _glossy_body(rng) if number % 2 else _matte_room(rng)


def differing_share(number):
    """Share of the pixels, away from edges, in which the cube has what rays have not nearby."""
    cube, rays, inner = images(number)
    low, high = (filtered(rays, size=(3, 3, 1)) for filtered in (minimum_filter, maximum_filter))
    beyond = np.maximum(low - cube, cube - high).max(axis=-1)
    return float(np.mean((beyond > STEPS) & inner))


def images(number):
    """Images of a scene by cube and by rays, and the mask of the pixels away from edges."""
    scene, at = scene_by_chance(number)
    sensor = fisheye(WIDTH_PX)
    if number % 2:
        middle = 0.5 * (WIDTH_PX - 1)
        lens = PerspectiveCamera(WIDTH_PX, WIDTH_PX, 1.2 * WIDTH_PX, (middle, middle))
        sensor = OmniCamera(lens, near_m=0.05)
    sensor = dataclasses.replace(sensor, supersampling=3, texels_per_pixel=2.9)
    found = by_both(scene, sensor, at, also=("instance",))
    cube, rays = (one.rgba[..., :3].astype(int) for one in found)
    instances = found[1].channels["instance"].astype(int)
    inner = minimum_filter(instances, 3) == maximum_filter(instances, 3)
    return cube, rays, inner & (found[1].rgba[..., 3] > 0)


@pytest.mark.parametrize("number", slow_but(range(4), 0, 1))
def test_few_materials_by_chance_are_those_of_rays(number):
    assert differing_share(number) <= MAX_SHARE


@pytest.mark.slow
@pytest.mark.parametrize("number", [23, 255, 263])
def test_normal_maps_reflect_nothing_below_the_surface(number):
    assert differing_share(number) <= MAX_SHARE


@pytest.mark.slow
@pytest.mark.long
def test_most_materials_by_chance_are_those_of_rays():
    shares = np.array([differing_share(number) for number in range(100, 200)])
    assert np.mean(shares <= MAX_SHARE) >= MIN_AGREEING, np.flatnonzero(shares > MAX_SHARE) + 100


def _matte_room(rng):
    """A closed room with bodies, lamps inside, and at times the sun outside."""
    walls = scaled(pose(), *ROOM_HALF_M)
    shell = box("room", 0, half_m=1.0)
    shell = dataclasses.replace(shell, triangles=shell.triangles[:, ::-1])
    meshes, places, materials = [shell], [walls], [_matte(rng, double_sided=bool(rng.integers(2)))]
    for number in range(1, int(rng.integers(3, 9))):
        meshes.append(_shape(rng, number))
        places.append(_place(rng, rng.uniform(-0.8, 0.8, 3) * ROOM_HALF_M, 0.5))
        materials.append(_matte(rng))
    centers_m = np.array([place[:3, 3] for place in places[1:]])
    lamps = [_lamp_in(rng, centers_m) for _ in range(rng.integers(1, 4))]
    if rng.integers(2):
        lamps.append(_sun(rng))
    lighting = Lighting(tuple(rng.uniform(0.0, 0.3, 3)), tuple(lamps), exposure=0.6)
    at_m = _away_from(rng, centers_m, 0.9)
    return scene_of(meshes, materials, places, lighting), _turned(rng, at_m)


def _glossy_body(rng):
    """A convex body below a sky, or before a plain background, in the light of lamps."""
    body = _shape(rng, 0)
    place = _place(rng, np.zeros(3), 1.0)
    lamps = [_sun(rng) for _ in range(rng.integers(0, 2))]
    for _ in range(rng.integers(0, 3)):
        away = rng.normal(size=3)
        lamps.append(_lamp(rng, 3.0 * away / np.linalg.norm(away), np.zeros(3)))
    sky = Environment(_sky(rng)) if rng.integers(2) else None
    even = rng.uniform(0.2, 0.6, 3) if sky is None else np.zeros(3)
    lighting = Lighting(tuple(even), tuple(lamps), environment=sky)
    away = rng.normal(size=3)
    eye = rng.uniform(2.0, 3.0) * away / np.linalg.norm(away)
    at = pose(
        eye,
        yaw_deg=np.degrees(np.arctan2(-eye[1], -eye[0])),
        pitch_deg=np.degrees(np.arctan2(eye[2], np.hypot(*eye[:2]))),
    )
    scene = scene_of([body], [_glossy(rng)], [place], lighting, tuple(even))
    return scene, at @ pose(roll_deg=rng.uniform(-180, 180))


def _shape(rng, material):
    """Box, ball or prism about the origin, of a radius near 1, with texture coordinates."""
    kind = rng.integers(3)
    if kind == 0:
        return box("box", material, half_m=0.6)
    if kind == 1:
        return dataclasses.replace(sphere(0.8, 40), material=material)
    return _prism(int(rng.integers(3, 9)), material)


def _prism(sides, material):
    """Upright prism without normals; each side has the whole of a texture."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    ring = 0.8 * np.stack((np.cos(turn), np.sin(turn)), axis=1)
    positions, coordinates, triangles = [], [], []
    for first in range(sides):
        left, right, start = ring[first], ring[(first + 1) % sides], len(positions)
        positions += [(*left, -0.7), (*right, -0.7), (*right, 0.7), (*left, 0.7)]
        coordinates += [(0, 1), (1, 1), (1, 0), (0, 0)]
        triangles += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    for z in (-0.7, 0.7):
        start = len(positions)
        positions += [(*one, z) for one in ring]
        coordinates += list(0.5 + 0.6 * ring)
        fan = [(start, start + at, start + at + 1) for at in range(1, sides - 1)]
        triangles += fan if z > 0 else [one[::-1] for one in fan]
    positions, coordinates = (np.array(one, dtype=np.float32) for one in (positions, coordinates))
    triangles = np.array(triangles, dtype=np.uint32)
    return Mesh("prism", positions, triangles, material, texture_coordinates=coordinates)


def _place(rng, center_m, size):
    """Pose with scales, at times mirrored."""
    factors = size * rng.uniform(0.5, 1.2, 3)
    factors[0] *= rng.choice((-1.0, 1.0))
    return scaled(_turned(rng, center_m), *factors)


def _turned(rng, at_m):
    roll_deg, pitch_deg, yaw_deg = rng.uniform(-180, 180, 3)
    return pose(tuple(at_m), roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)


def _away_from(rng, centers_m, distance_m):
    """Place in the room at a distance from bodies."""
    while True:
        at_m = rng.uniform(-0.75, 0.75, 3) * ROOM_HALF_M
        if np.linalg.norm(centers_m - at_m, axis=1).min(initial=np.inf) > distance_m:
            return at_m


def _sun(rng):
    direction = rng.normal(size=3)
    return Light(
        LightKind.DIRECTIONAL, tuple(rng.uniform(0.5, 1.0, 3)), rng.uniform(0.2, 0.8),
        direction=direction / np.linalg.norm(direction), casts_shadow=bool(rng.integers(2)),
    )  # fmt: skip


def _lamp_in(rng, centers_m):
    return _lamp(rng, _away_from(rng, centers_m, 0.9), rng.uniform(-1.0, 1.0, 3))


def _lamp(rng, at_m, toward_m):
    """Point or spot light."""
    direction = toward_m - at_m
    kind = LightKind.SPOT if rng.integers(2) else LightKind.POINT
    return Light(
        kind, tuple(rng.uniform(0.5, 1.0, 3)), rng.uniform(1.0, 3.0), at_m,
        direction / np.linalg.norm(direction), cone_cosines=(0.9, 0.6),
        casts_shadow=bool(rng.integers(2)),
    )  # fmt: skip


def _sky(rng):
    """Radiance of a smooth sky."""
    directions, _ = map_directions(64, 128)
    axes = rng.normal(size=(3, 3))
    waves = np.sin(2.0 * directions @ axes.T + rng.uniform(0.0, 6.0, 3))
    return (0.5 + 0.3 * waves).astype(np.float32)


def _texture(rng, low=0, high=256, is_linear=False):
    """Coarse random values, wrapped and placed by chance."""
    cells = int(rng.choice((2, 4, 8)))
    pixels = np.kron(
        rng.integers(low, high, (cells, cells, 4)), np.ones((64 // cells, 64 // cells, 1))
    ).astype(np.uint8)
    pixels[..., 3] = 255
    turn, (x, y) = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.5, 2.0, 2)
    transform = (
        (x * np.cos(turn), -y * np.sin(turn), rng.uniform(-1, 1)),
        (x * np.sin(turn), y * np.cos(turn), rng.uniform(-1, 1)),
    )
    wraps = rng.choice([Wrap.REPEAT, Wrap.CLAMP_TO_EDGE], 2)
    options = {"uv_transform": transform} if is_linear else {}
    return Texture(pixels, *wraps, is_linear=is_linear, **options)


def _normal_map(rng):
    leaning = _texture(rng, 90, 166, is_linear=True)
    leaning.pixels[..., 2] = 255
    return leaning


def _sometimes(rng, make, *arguments, **options):
    return make(rng, *arguments, **options) if rng.integers(2) else None


def _matte(rng, **options):
    return Material(
        base_color=(*rng.uniform(0.1, 0.9, 3), 1.0),
        texture=_sometimes(rng, _texture),
        normal_map=_sometimes(rng, _normal_map),
        normal_scale=rng.uniform(0.3, 1.5),
        **options,
    )


def _glossy(rng):
    roughness = rng.choice((0.0, rng.uniform(0.05, 0.3), rng.uniform(0.3, 0.5), rng.uniform(0, 1)))
    return dataclasses.replace(
        _matte(rng),
        metallic=rng.choice((0.0, 1.0, rng.uniform())),
        roughness=float(roughness),
        specular=1.0,
        metallic_roughness_map=_sometimes(rng, _texture, 100, is_linear=True),
        occlusion_map=_sometimes(rng, _texture, is_linear=True),
        emissive=tuple(rng.uniform(0.0, 0.3, 3)) if rng.integers(4) == 0 else (0.0, 0.0, 0.0),
        clearcoat=float(rng.integers(4) == 0),
        clearcoat_roughness=rng.uniform(0.0, 0.5),
    )
