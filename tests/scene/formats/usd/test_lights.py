"""Lights of UsdLux: illuminance against integrals over their surfaces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.files.image_files import write_radiance
from omnisim.scene.light.lighting import illuminance
from omnisim.scene.model import LightKind
from tests.scene.formats.usd.stages import define_box, new_stage, saved

from pxr import UsdGeom, UsdLux  # isort: skip - skipped without it

FAR_M = 30.0  # from where a lamp's size does not count


def _light(tmp_path, kind, meters_per_unit=1.0, shape=None, **values):
    """Light of a stage, 30 m above its origin and facing down."""
    stage = new_stage(tmp_path / "a.usda", meters_per_unit=meters_per_unit)
    define_box(stage, "/World/box")
    light = kind.Define(stage, "/World/light")
    UsdGeom.XformCommonAPI(light).SetTranslate((0.0, 0.0, FAR_M / meters_per_unit))
    for name, value in values.items():
        light.GetPrim().GetAttribute(f"inputs:{name}").Set(value)
    if shape is not None:
        api = UsdLux.ShapingAPI.Apply(light.GetPrim())
        api.CreateShapingConeAngleAttr(shape)
    scene = saved(stage)
    (one,) = scene.lighting.lights
    return scene, one


def _lux_at_origin(light):
    return float(illuminance(light, np.zeros((1, 3)), np.array([(0.0, 0.0, 1.0)]))[0])


def _lux_of_samples(points, normals, areas, luminance):
    """Illuminance of the floor at the origin by surface elements: L cos cos' dA / r²."""
    distances = np.linalg.norm(points, axis=1)
    emitted = np.maximum(-np.einsum("nd,nd->n", normals, points) / distances, 0.0)
    return float((luminance * emitted * points[:, 2] / distances * areas / distances**2).sum())


def _sphere(radius):
    count = 20_000
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.arange(count) * 2.399963
    ring = np.sqrt(1.0 - z * z)
    normals = np.stack((ring * np.cos(angle), ring * np.sin(angle), z), axis=1)
    areas = np.full(count, 4.0 * np.pi * radius**2 / count)
    return normals * radius + (0.0, 0.0, FAR_M), normals, areas


def _rectangle(width, height):
    side = (np.arange(50) + 0.5) / 50 - 0.5
    x, y = (axis.ravel() for axis in np.meshgrid(side * width, side * height))
    points = np.stack((x, y, np.full(x.shape, FAR_M)), axis=1)
    return points, np.tile((0.0, 0.0, -1.0), (len(x), 1)), np.full(len(x), width * height / 2500)


@pytest.mark.parametrize("meters_per_unit", [1.0, 0.01])
def test_a_sphere_shines_as_its_surface_does(tmp_path, meters_per_unit):
    _, light = _light(
        tmp_path, UsdLux.SphereLight, meters_per_unit, intensity=500.0, exposure=1.0,
        radius=0.3 / meters_per_unit,
    )  # fmt: skip
    assert light.kind is LightKind.POINT
    expected = _lux_of_samples(*_sphere(0.3), 1000.0)
    assert _lux_at_origin(light) == pytest.approx(expected, rel=1e-3)


def test_a_rectangle_shines_ahead_as_its_surface_does(tmp_path):
    scene, light = _light(tmp_path, UsdLux.RectLight, intensity=700.0, width=0.8, height=0.5)
    expected = _lux_of_samples(*_rectangle(0.8, 0.5), 700.0)
    assert _lux_at_origin(light) == pytest.approx(expected, rel=1e-3)
    np.testing.assert_allclose(light.direction, (0.0, 0.0, -1.0), atol=1e-12)
    assert scene.notices == (
        "a.usda: RectLight is drawn as a lamp at its center, without its size (1 prim)",
    )


@pytest.mark.slow
def test_normalized_lights_do_not_depend_on_their_size(tmp_path):
    for kind in (UsdLux.SphereLight, UsdLux.DiskLight):
        lux = []
        for radius in (0.1, 0.7):
            _, light = _light(tmp_path, kind, intensity=9.0, radius=radius, normalize=True)
            lux.append(_lux_at_origin(light))
        assert lux[0] == pytest.approx(lux[1])


def test_a_distant_light_is_a_sun(tmp_path):
    _, light = _light(tmp_path, UsdLux.DistantLight, intensity=1e5, angle=0.53)
    assert light.kind is LightKind.DIRECTIONAL
    half = np.radians(0.265)
    assert _lux_at_origin(light) == pytest.approx(1e5 * np.pi * np.sin(half) ** 2)
    _, light = _light(tmp_path, UsdLux.DistantLight, intensity=800.0, normalize=True)
    assert _lux_at_origin(light) == pytest.approx(800.0)


def test_a_shaped_light_is_a_spot(tmp_path):
    _, light = _light(tmp_path, UsdLux.SphereLight, shape=30.0, intensity=5.0)
    assert light.kind is LightKind.SPOT
    assert light.cone_cosines[1] == pytest.approx(np.cos(np.radians(30.0)))


def test_colors_are_those_of_the_temperature(tmp_path):
    _, light = _light(
        tmp_path, UsdLux.SphereLight, colorTemperature=3000.0, enableColorTemperature=True
    )
    assert light.color == pytest.approx(tuple(UsdLux.BlackbodyTemperatureAsRgb(3000.0)))


def test_a_dome_is_the_light_from_everywhere_and_the_background(stage):
    define_box(stage, "/World/box")
    dome = UsdLux.DomeLight.Define(stage, "/World/dome")
    dome.CreateColorAttr((0.5, 0.75, 1.0))
    dome.CreateIntensityAttr(40.0)
    scene = saved(stage)
    assert scene.lighting.ambient == pytest.approx((0.5, 0.75, 1.0))
    assert scene.background == scene.lighting.ambient
    assert scene.lighting.lights == ()
    sun = UsdLux.DistantLight.Define(stage, "/World/sun")
    sun.CreateIntensityAttr(40.0 * np.pi)
    sun.CreateNormalizeAttr(True)
    scene = saved(stage)
    (light,) = scene.lighting.lights
    # the sun gives a surface that faces it as much light as the brightest of the dome does
    assert scene.lighting.ambient[2] == pytest.approx(light.intensity * scene.lighting.exposure)


def _textured(tmp_path, pixels, up="Z", rotate=(0.0, 0.0, 0.0), name="map.exr"):
    """Scene of a box under a dome with a map."""
    stage = new_stage(tmp_path / "a.usda")
    UsdGeom.SetStageUpAxis(stage, up)
    define_box(stage, "/World/box")
    dome = UsdLux.DomeLight.Define(stage, "/World/dome")
    dome.CreateTextureFileAttr(name)
    dome.CreateIntensityAttr(20.0)
    UsdGeom.XformCommonAPI(dome).SetRotate(rotate)
    if pixels is not None:
        write_radiance(tmp_path / name, pixels.astype(np.float16))
    return saved(stage)


def _storm(directions):
    """Texture coordinates of Hydra Storm's projectToLatLong, from the top left."""
    x, y, z = directions.T
    return (np.arctan2(z, x) + 0.5 * np.pi) / (2.0 * np.pi) % 1.0, np.arccos(y) / np.pi


@pytest.mark.parametrize(
    ("up", "rotate"),
    [("Y", (0.0, 0.0, 0.0)), ("Z", (90.0, 0.0, 0.0)), ("Y", (20.0, 130.0, -40.0))],
)
def test_a_domes_texture_is_where_storm_has_it(tmp_path, up, rotate):
    across, down = np.meshgrid((np.arange(256) + 0.5) / 256, (np.arange(128) + 0.5) / 128)
    # smooth in the direction: no seam
    angle = 2.0 * np.pi * across
    pixels = np.stack((1.2 + np.cos(angle), 1.2 + np.sin(angle), 0.2 + down), axis=-1)
    environment = _textured(tmp_path, pixels, up, rotate).lighting.environment
    generator = np.random.default_rng(5)
    directions = generator.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    stage_from_dome = Rotation.from_euler("xyz", rotate, degrees=True).as_matrix()
    stage = directions[:, (0, 2, 1)] * (1.0, 1.0, -1.0) if up == "Y" else directions
    dome = stage @ stage_from_dome
    u, v = _storm(dome[np.abs(dome[:, 1]) < 0.95])
    expected = np.stack(
        (1.2 + np.cos(2.0 * np.pi * u), 1.2 + np.sin(2.0 * np.pi * u), 0.2 + v), axis=-1
    )
    found = environment.seen(directions[np.abs(dome[:, 1]) < 0.95])
    ratio = found / expected
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.03)


def test_an_even_texture_is_as_bright_as_a_dome_without(tmp_path):
    lighting = _textured(tmp_path, np.full((16, 32, 3), (1.0, 1.5, 2.0))).lighting
    assert lighting.ambient == (0.0, 0.0, 0.0)
    light = lighting.environment.ambient(np.eye(3))
    np.testing.assert_allclose(light, [(0.5, 0.75, 1.0)] * 3, rtol=1e-3)
    assert lighting.exposure == pytest.approx(1.0 / (np.pi * 40.0), rel=1e-3)


@pytest.mark.parametrize("content", [None, b"no image"])
def test_a_texture_that_cannot_be_read_leaves_the_color(tmp_path, content):
    if content is not None:
        (tmp_path / "map.exr").write_bytes(content)
    scene = _textured(tmp_path, None)
    assert scene.lighting.environment is None
    assert scene.lighting.ambient == (1.0, 1.0, 1.0)
    assert any("texture of a dome light is not drawn" in notice for notice in scene.notices)
