"""Both back ends shade the same materials alike, by different code."""

import dataclasses

import numpy as np
import pytest

import omnisim
from omnisim.cameras import EquirectangularCamera, pixel_grid
from omnisim.core.cube import face_index
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.scene.light.environment import Environment, map_directions
from omnisim.scene.model import AlphaMode, Light, Lighting, LightKind, Material, Texture
from omnisim.validation import material_chart
from tests.rendering.frames import BACKENDS, by_both, each_backend, frame_of
from tests.scenes import next_to_another_face, scene_of, square, upright

pytest.importorskip("embreex")
pytestmark = pytest.mark.usefixtures("needs_opengl", "untraced_reflections")


def _unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


def _sky():
    """Map without symmetry, with a bright spot."""
    directions, _ = map_directions(64, 128)
    colors = 0.5 + 0.3 * directions + 0.15 * np.sin(6.0 * directions[..., [1, 2, 0]])
    colors += 8.0 * (directions @ _unit(0.3, -0.6, 0.7) > 0.97)[..., None]
    return Environment(colors.astype(np.float32))


CAMERA = dataclasses.replace(material_chart.camera().resized(82), supersampling=2)
# where texels of normals or holes must be no smaller than pixels
FINE_CAMERA = CAMERA.resized(165)
LIGHTS = (
    Light(LightKind.DIRECTIONAL, (1.0, 0.9, 0.8), 0.5, direction=_unit(0.6, -0.5, -0.62)),
    Light(LightKind.POINT, (0.3, 1.0, 0.5), 4.0, np.array([3.0, -2.0, 1.0])),
    Light(
        LightKind.SPOT, (0.4, 0.5, 1.0), 20.0, np.array([2.0, 2.5, 3.0]), _unit(1.0, -0.6, -0.7),
        range_m=30.0, cone_cosines=(0.95, 0.8),
    ),
)  # fmt: skip
LIGHTINGS = {
    "lamps": Lighting((0.2, 0.2, 0.25), LIGHTS),
    "even light": Lighting((0.8, 0.7, 0.6), ()),
    "sky": Lighting((0.0, 0.0, 0.0), LIGHTS[:1], environment=_sky()),
}


def _texture(seed, size=16, low=0, high=256, **options):
    """Smooth texture of random values, without which mip levels would count most."""
    coarse = np.random.default_rng(seed).integers(low, high, (4, 4, 4))
    pixels = np.kron(coarse, np.ones((size // 4, size // 4, 1))).astype(np.uint8)
    pixels[..., 3] = 255
    return Texture(pixels, **options)


NORMALS = _texture(3, low=90, high=166, is_linear=True)
MATERIALS = {
    "chart": {},
    "coat": {"clearcoat": 0.8, "clearcoat_roughness": 0.2},
    "tinted gloss": {"specular": 0.7, "specular_color": (0.2, 0.9, 3.0), "ior": 1.8},
    "metal map": {"metallic_roughness_map": _texture(1, is_linear=True), "roughness": 0.8},
    "occlusion map and emission": {
        "occlusion_map": _texture(2, is_linear=True), "occlusion_strength": 0.7, "metallic": 0.5,
        "emissive": (0.1, 0.3, 0.05), "emissive_map": _texture(5),
    },
    "specular map": {"specular": 0.9, "specular_color": (1.0, 2.0, 4.0), "specular_map": Texture(
        np.dstack((_texture(11).pixels[..., :3], _texture(12).pixels[..., 0]))
    )},
    "coat maps": {
        "clearcoat": 0.9, "clearcoat_roughness": 0.7,
        "clearcoat_map": _texture(13, is_linear=True),
        "clearcoat_normal_map": NORMALS, "clearcoat_normal_scale": 0.8,
    },
    "second coordinates": {
        "normal_map": dataclasses.replace(
            NORMALS, uv_set=1, uv_transform=((0.0, 2.0, 0.1), (-1.0, 0.5, 0.0))
        ),
        "normal_scale": 1.3,
        "texture": _texture(7),
    },
}  # fmt: skip


def _spheres(lighting, **values):
    scene = material_chart.chart(lighting)
    materials = tuple(dataclasses.replace(material, **values) for material in scene.materials)
    shape = material_chart.sphere(material_chart.RADIUS_M, rows=24)
    second = shape.texture_coordinates[:, ::-1]
    meshes = tuple(
        dataclasses.replace(
            shape, name=mesh.name, material=mesh.material, second_texture_coordinates=second
        )
        for mesh in scene.meshes
    )
    return dataclasses.replace(scene, materials=materials, meshes=meshes)


def _image(scene, camera, backend="cube", pose=None):
    pose = np.eye(4) if pose is None else pose
    return frame_of(scene, camera, pose, backend).rgba.astype(int)


def _difference(scene, camera):
    """Differences of the two back ends in steps of 255."""
    cube, rays = (_image(scene, camera, backend) for backend in BACKENDS)
    assert cube[..., :3].max() > 100, "expected an image of something"
    return np.abs(cube - rays)[..., :3].max(axis=2)


def _difference_on_spheres(scene, camera):
    """Pixels of spheres, without outlines, which each back end draws by samples of its own."""
    shown = material_chart.sphere_of_pixels(camera.model) >= 0
    return _difference(scene, camera)[shown]


@pytest.mark.parametrize(
    ("lighting", "material"),
    [("lamps", "chart"), ("even light", "chart"), *(("sky", one) for one in MATERIALS)],
)
def test_both_back_ends_agree(lighting, material):
    scene = _spheres(LIGHTINGS[lighting], **MATERIALS[material])
    is_fine = material == "second coordinates"
    difference = _difference_on_spheres(scene, FINE_CAMERA if is_fine else CAMERA)
    # texels of a map that are as large as pixels are filtered over texels of the atlas, or samples
    has_maps = any(isinstance(one, Texture) for one in MATERIALS[material].values())
    assert difference.mean() < (1.5 if has_maps else 0.6)
    assert np.percentile(difference, 90 if has_maps else 98) <= 4


@each_backend
def test_even_maps_are_factors(backend):
    """Gloss and clear coats: sRGB's 188 is 0.503 of light, 128 is 0.502 of a number."""
    gloss = Texture(np.full((4, 4, 4), (188, 255, 128, 128), np.uint8))
    coat = Texture(np.full((4, 4, 4), (128, 64, 0, 255), np.uint8), is_linear=True)
    flat = Texture(np.full((4, 4, 4), (128, 128, 255, 255), np.uint8), is_linear=True)
    with_maps = {
        "specular": 1.0, "specular_color": (3.0, 2.0, 1.0), "specular_map": gloss,
        "clearcoat": 1.0, "clearcoat_roughness": 1.0, "clearcoat_map": coat,
        "clearcoat_normal_map": flat, "clearcoat_normal_scale": 0.0,
    }  # fmt: skip
    factors = {
        "specular": 128 / 255, "specular_color": (3.0 * 0.5029, 2.0, 0.2159),
        "clearcoat": 128 / 255, "clearcoat_roughness": 64 / 255,
    }  # fmt: skip
    one, other, plain = (
        _image(_spheres(LIGHTINGS["lamps"], **values), CAMERA, backend)
        for values in (with_maps, factors, {})
    )
    assert np.abs(one - other).max() <= 2
    assert np.abs(one - plain).max() > 20


@pytest.mark.parametrize("double_sided", [True, False])
def test_a_glossy_floor_has_no_edges_of_the_cube(double_sided):
    floor = square(4.0, -1.0, texture_coordinates=np.array([[0, 0], [4, 0], [4, 4], [0, 4]], "f4"))
    glossy = Material(
        base_color=(0.3, 0.3, 0.3, 1.0), metallic=0.8, roughness=0.3, specular=1.0,
        normal_map=NORMALS, double_sided=double_sided,
    )  # fmt: skip
    scene = scene_of([floor], [glossy], lighting=LIGHTINGS["sky"])
    difference = _difference(scene, OmniCamera().resized(160))
    assert difference.mean() < 0.6
    assert np.percentile(difference, 98) <= 6


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_gloss_has_no_seam_where_faces_of_the_cube_meet(metallic):
    """The view is the ray's, not the axis of its face: beside an edge between two faces an image
    differs from one of rays, which has no faces, by no more than elsewhere."""
    sphere = dataclasses.replace(material_chart.sphere(1.0), name="bowl")
    glossy = Material(
        base_color=(0.8, 0.6, 0.5, 1.0), metallic=metallic, roughness=0.25, specular=1.0,
        double_sided=True,
    )  # fmt: skip
    # the inside of a bowl: it is behind all edges of the cube
    scene = scene_of([sphere], [glossy], lighting=LIGHTINGS["sky"])
    lens = EquirectangularCamera(256, 128)
    camera = OmniCamera(lens, polygons=None, supersampling=2)
    pose = omnisim.pose((0.3, -0.2, 0.1), roll_deg=20.0, pitch_deg=-10.0, yaw_deg=15.0)
    cube, ours = by_both(scene, camera, pose, linear=True)
    apart = np.abs(cube.linear - ours.linear).max(axis=-1)
    rays = lens.ray_from_pixel(pixel_grid(256, 128)).directions @ lens.rig_from_optical.T
    edge = next_to_another_face(face_index(rays))
    assert edge.mean() > 0.03
    assert apart.mean() < 2e-3
    assert apart[edge].mean() < 1.5 * apart[~edge].mean() + 1e-4
    assert np.percentile(apart[edge], 99) < 5e-3  # half a step of 8 bits, of mid-gray


def test_the_back_of_a_sheet_has_the_front_s_bumps_as_dents():
    """The normal of the back is the front's, turned round: a sheet is one surface."""
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "f4")
    sheet = upright(1.0, texture_coordinates=uv)
    pixels = np.full((4, 4, 4), (200, 128, 230, 255), np.uint8)  # leans towards +u, which is +y
    material = Material(double_sided=True, specular=0.0, normal_map=Texture(pixels, is_linear=True))
    suns = [
        Light(LightKind.DIRECTIONAL, (1.0,) * 3, 0.6, direction=direction)
        for direction in (_unit(-1.0, -1.0, 0.0), _unit(-1.0, 1.0, 0.0), _unit(1.0, -1.0, 0.0))
    ]
    lit = [scene_of([sheet], [material], lighting=Lighting((0.0,) * 3, (sun,))) for sun in suns]
    front, behind = omnisim.pose((2.0, 0, 0), yaw_deg=180.0), omnisim.pose((-2.0, 0, 0))
    for backend in BACKENDS:
        towards, away = (_image(scene, CAMERA, backend, front)[40, 20, 0] for scene in lit[:2])
        assert towards > away + 40
        # n of the back is −n of the front: it leans towards −y
        assert abs(_image(lit[2], CAMERA, backend, behind)[40, 20, 0] - away) <= 2


@each_backend
@pytest.mark.parametrize(
    ("slot", "casts_shadow"), [("normal_map", False), ("clearcoat_normal_map", True)]
)
def test_light_from_behind_a_surface_does_not_light_it(backend, slot, casts_shadow):
    """A normal map tilts the floor by 60° toward a sun that is 3° below it."""
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "f4")
    pixels = np.full((4, 4, 4), (238, 128, 191, 255), np.uint8)
    leaning = {slot: Texture(pixels, is_linear=True)}
    material = Material(clearcoat=1.0, clearcoat_roughness=0.6, roughness=0.5, **leaning)
    images = []
    for from_below in (-0.05, 0.05, None):
        direction = _unit(-1.0, 0.0, -(from_below or 0.0))
        sun = Light(LightKind.DIRECTIONAL, (1.0,) * 3, 0.6, direction=direction,
                    casts_shadow=casts_shadow)  # fmt: skip
        lighting = Lighting((0.1,) * 3, () if from_below is None else (sun,))
        floor = square(2.0, -1.0, texture_coordinates=uv)
        scene = scene_of([floor], [material], lighting=lighting)
        images.append(_image(scene, CAMERA.resized(40), backend))
    behind, before, dark = images
    np.testing.assert_array_equal(behind, dark)
    assert (before - dark).max() > 10


@pytest.mark.parametrize("alpha_mode", [AlphaMode.MASK, AlphaMode.BLEND])
def test_masked_and_blended_materials_have_gloss(alpha_mode):
    pixels = _texture(9).pixels.copy()
    pixels[4:8, :, 3] = 100
    values = {"alpha_mode": alpha_mode, "texture": Texture(pixels), "roughness": 0.5}
    scene = _spheres(LIGHTINGS["sky"], **values)
    difference = _difference_on_spheres(scene, FINE_CAMERA)
    assert difference.mean() < 0.8


def test_a_matte_scene_has_no_gloss():
    """Materials keep their values, and are drawn as if they had none."""
    full = _spheres(LIGHTINGS["lamps"])
    matte = dataclasses.replace(full, lighting=dataclasses.replace(full.lighting, is_matte=True))
    plain = dataclasses.replace(
        full, materials=tuple(Material("", material.base_color) for material in full.materials)
    )
    for backend in BACKENDS:
        assert (_image(matte, CAMERA, backend) == _image(plain, CAMERA, backend)).all()
