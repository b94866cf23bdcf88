"""Roughness, metalness and emission of what rays hit, in both back ends."""

import dataclasses

import numpy as np
import pytest

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.scene.model import AlphaMode, Lighting, Material, Mesh, Texture
from tests.scenes import scene_of, square

pytestmark = pytest.mark.usefixtures("needs_opengl")

NAMES = ("roughness", "metallic", "emissive", "position", "instance")
LENS = EquidistantCamera(120, 100, 40.0, (58.5, 50.25))
CAMERA = omnisim.OmniCamera(LENS, polygons=None, supersampling=1)
HALF_M, UP_M, TEXELS = 3.0, 1.0, 8
BACKENDS = ["cube", pytest.param("rays", marks=pytest.mark.filterwarnings("default"))]
HALF_FLOAT = 5e-4  # what one rounds, of 1
EVEN = Lighting((1.0, 1.0, 1.0), ())


def _truth(scene, backend="cube", names=NAMES):
    if backend == "rays":
        pytest.importorskip("embreex")
    with omnisim.open_sensor(scene, CAMERA, backend=backend) as renderer:
        return renderer.render(_looking_down(), also=names).channels


def _looking_down():
    return omnisim.pose((0.1, -0.2, UP_M), pitch_deg=80.0)


def _texture(seed, **options):
    pixels = np.random.default_rng(seed).integers(0, 256, (TEXELS, TEXELS, 4)).astype(np.uint8)
    pixels[..., 3] = 255
    return Texture(pixels, **options)


def _floor(**options):
    """Square at z = 0, whose texture coordinates are 0.5 + x / 6 and 0.5 + y / 6."""
    corners = 2 * HALF_M * (np.array([[0, 0], [1, 0], [1, 1], [0, 1]], "f4") - 0.5)
    positions = np.column_stack((corners, np.zeros(4, "f4")))
    triangles = np.array([[0, 1, 2], [0, 2, 3]], "u4")
    uv = (corners / (2 * HALF_M) + 0.5).astype("f4")
    return Mesh("floor", positions, triangles, 0, None, uv, **options)


def _bilinear(values, uv):
    """Values (n, k) of texels (height, width, k), by an independent interpolation."""
    from scipy.ndimage import map_coordinates

    at = uv[:, ::-1].T * TEXELS - 0.5
    layers = np.moveaxis(values.astype(float), -1, 0)
    return np.stack([map_coordinates(layer, at, order=1, mode="grid-wrap") for layer in layers], 1)


@pytest.mark.parametrize("backend", BACKENDS)
def test_factors_are_those_of_the_materials(backend):
    """Metal, a light, a matte and an unlit sheet."""
    materials = [
        Material(metallic=1.0, roughness=0.3, specular=1.0),
        Material(emissive=(4.0, 0.5, 0.0), specular=1.0, roughness=0.7),
        Material(base_color=(0.2, 0.3, 0.4, 1.0)),
        Material(unlit=True, metallic=1.0, roughness=0.2, emissive=(1.0, 1.0, 1.0)),
    ]
    sheets = [dataclasses.replace(square(0.5, 0.0), material=number) for number in range(4)]
    poses = [
        omnisim.pose((x, y, 0.0)) for x, y in ((-0.6, 0.6), (0.6, 0.6), (-0.6, -0.6), (0.6, -0.6))
    ]
    found = _truth(scene_of(sheets, materials, poses, lighting=EVEN), backend)
    nothing, matte = (np.nan, np.nan, 0, 0, 0), (1, 0, 0, 0, 0)
    expected = [nothing, (0.3, 1, 0, 0, 0), (0.7, 0, 4, 0.5, 0), matte, matte]
    assert set(np.unique(found["instance"])) == set(range(5))
    values = np.dstack((found["roughness"], found["metallic"], found["emissive"]))
    np.testing.assert_allclose(
        values, np.array(expected)[found["instance"]], rtol=HALF_FLOAT, atol=HALF_FLOAT
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("second", "alpha_mode"), [(False, AlphaMode.BLEND), (True, AlphaMode.OPAQUE)]
)
def test_maps_multiply_the_factors(backend, second, alpha_mode):
    """Between texels as SciPy interpolates; the floor is larger than its texels are seen."""
    options = {"uv_set": 1, "uv_transform": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))} if second else {}
    metal, light = _texture(1, is_linear=True, **options), _texture(2, **options)
    material = Material(
        metallic=0.9, roughness=0.8, specular=1.0, emissive=(2.0, 1.0, 0.5), alpha_mode=alpha_mode,
        metallic_roughness_map=metal, emissive_map=light,
    )  # fmt: skip
    floor = _floor()
    if second:  # the set is turned, and its transform turns it back
        floor = dataclasses.replace(
            floor, second_texture_coordinates=floor.texture_coordinates[:, ::-1].copy()
        )
    found = _truth(scene_of([floor], [material], lighting=EVEN), backend)
    hit = (found["instance"] == 1) & (np.abs(found["position"][..., :2]).max(axis=-1) < 1.5)
    assert hit.mean() > 0.2
    uv = found["position"][hit][:, :2] / (2 * HALF_M) + 0.5
    share = _bilinear(metal.pixels[..., 1:3] / 255.0, uv)
    srgb = light.pixels[..., :3] / 255.0
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    expected = np.column_stack(
        (0.8 * share[:, 0], 0.9 * share[:, 1], _bilinear(linear, uv) * (2, 1, 0.5))
    )
    values = np.column_stack(
        (found["roughness"][hit], found["metallic"][hit], found["emissive"][hit])
    )
    # the cube shows a texel beside the ray: 0.7 of a pixel, which is a twentieth of a texel
    # of the map; filters of GPUs have steps of 1/256
    limit = 0.1 if backend == "cube" else 5e-3
    assert np.quantile(np.abs(values - expected), 0.99) < limit
    assert np.abs(values - expected).mean() < 0.2 * limit


def test_a_scene_drawn_matte_is_matte():
    material = Material(metallic=1.0, roughness=0.3, emissive=(1.0, 1.0, 1.0), specular=1.0)
    lighting = dataclasses.replace(EVEN, is_matte=True)
    scene = scene_of([_floor()], [material], lighting=lighting)
    for backend in ("cube", "rays"):
        found = _truth(scene, backend)
        hit = found["instance"] > 0
        assert (found["roughness"][hit] == 1.0).all()
        assert not found["metallic"][hit].any()
        assert not found["emissive"].any()


def test_batches_have_the_materials_of_single_frames():
    """Also after a frame that asked for other channels, and of an instance that moved."""
    metal = _texture(1, is_linear=True)
    material = Material(metallic=0.9, roughness=0.8, specular=1.0, metallic_roughness_map=metal)
    sheet = dataclasses.replace(square(0.4, 0.5), material=1)
    scene = scene_of(
        [_floor(), sheet], [material, Material(emissive=(3.0, 2.0, 1.0))], lighting=EVEN
    )
    pose = scene.pose_of("object 1")
    pose[0, 3] += 0.3
    names = ("roughness", "metallic", "emissive", "albedo", "normals")
    poses = [omnisim.pose((0.1 * x, 0.0, UP_M), pitch_deg=80.0) for x in range(2)]
    with omnisim.open_sensor(scene, CAMERA) as renderer:
        renderer.render(poses[0], also=("albedo",))
        for edited in (scene, scene.moved("object 1", pose)):
            renderer.scene = edited
            batch = renderer.render_batch(poses, channels=names)
            assert batch["emissive"].max() == 3.0
            for number, one in enumerate(poses):
                for name, values in renderer.render(one, also=names).channels.items():
                    np.testing.assert_array_equal(batch[name][number], values, err_msg=name)
