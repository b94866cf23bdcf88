"""Chromatic optical systems: lateral color behind a flat port is Snell's, channel by channel."""

import dataclasses

import numpy as np
import pytest

from omnisim import OmniCamera, open_sensor
from omnisim.cameras import EquidistantCamera, PerspectiveCamera, pixel_grid
from omnisim.cameras.optics import OpticalSystem, Surface
from omnisim.cameras.optics.shapes import Plane
from omnisim.cameras.optics.surface import refractive_index
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core.errors import OpticsError, SensorFileError
from omnisim.core.poses import pose
from omnisim.rendering.camera.captured_image import valid_mask
from omnisim.rendering.camera.degradations import Degradation, Shutter
from omnisim.scene.model import Material, Mesh
from omnisim.validation.image_differences import psnr_db
from tests.cameras.optics.examples import ALL, SYSTEMS
from tests.scenes import room, scene_of

WATER = (1.30, 1.33, 1.36)  # far more dispersion than real water's
PORT_M, DISC_M = 0.05, 1.0
LENS = PerspectiveCamera(100, 100, 60.0, (49.5, 49.5))
FLAT = OpticalSystem(
    LENS, (Surface(Plane(), pose((0.0, 0.0, PORT_M)), medium=WATER),), medium="vacuum"
)
CHROMATIC = dataclasses.replace(FLAT, chromatic=True)
FISHEYE = dataclasses.replace(SYSTEMS["port"].scaled(0.25), chromatic=True)
needs_opengl = pytest.mark.usefixtures("needs_opengl")


@pytest.fixture(autouse=True)
def embree():
    """Skip without the ray caster."""
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")


def _disc(radius_m):
    """A white disc across the axis; the camera looks along the rig's x."""
    angles = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    around = radius_m * np.stack((0.0 * angles, np.cos(angles), np.sin(angles)), axis=1)
    corners = np.concatenate((np.zeros((1, 3)), around)) + (DISC_M, 0.0, 0.0)
    numbers = np.arange(1, 721)
    triangles = np.stack((np.zeros(720, dtype=int), numbers, np.roll(numbers, -1)), axis=1)
    disc = Mesh("disc", corners.astype(np.float32), triangles.astype(np.uint32), 0)
    return scene_of([disc], [Material(double_sided=True)])


def _snell_px(radius_m, index):
    """Image radius of a circle on the disc's plane: Snell's law, solved by bisection."""
    low, high = 0.0, np.pi / 2 - 1e-9
    for _ in range(200):
        angle = 0.5 * (low + high)
        within = np.arcsin(np.sin(angle) / index)
        reached_m = PORT_M * np.tan(angle) + (DISC_M - PORT_M) * np.tan(within)
        low, high = (angle, high) if reached_m < radius_m else (low, angle)
    return LENS.focal_length_px * np.tan(low)


@needs_opengl
@pytest.mark.parametrize(("backend", "off_px"), [("cube", 0.06), ("rays", 0.02)])
def test_lateral_color_behind_a_flat_port_is_snells(backend, off_px):
    """A disc's radius in each channel, by its area; they are up to 2.2 px apart.

    Edges of the virtual cameras are theirs to a fraction of a texel.
    """
    sensor = OmniCamera(CHROMATIC, supersampling=4, texels_per_pixel=4.0)
    with open_sensor(_disc(0.45), sensor, unlit=True, backend=backend) as renderer:
        linear = renderer.render(np.eye(4), linear=True).linear
    found = np.sqrt(linear.sum(axis=(0, 1)) / np.pi)
    expected = [_snell_px(0.45, index) for index in WATER]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=off_px)
    assert expected[2] - expected[0] > 0.5


def test_rays_of_each_channel_are_its_wavelengths():
    for name in ("port", "dome"):
        system = dataclasses.replace(SYSTEMS[name], chromatic=True)
        pixels = np.random.default_rng(1).uniform(0.0, 359.0, (200, 2))
        for color, one in zip("RGB", system.by_color(), strict=True):
            own = dataclasses.replace(SYSTEMS[name], color=color)
            np.testing.assert_array_equal(one.rays(pixels).directions, own.rays(pixels).directions)
            media = [refractive_index(name, color) for name in ("air", "acrylic", "water")]
            assert list(one.indices) == media
        green = dataclasses.replace(SYSTEMS[name], color="G")
        np.testing.assert_array_equal(system.rays(pixels).directions, green.rays(pixels).directions)
    mirror = dataclasses.replace(SYSTEMS["sphere"], chromatic=True)
    assert mirror.by_color() == (mirror,)
    assert SYSTEMS["port"].by_color() == (SYSTEMS["port"],)
    grid = pixel_grid(FISHEYE.width_px, FISHEYE.height_px)
    green = FISHEYE.of_color("G").rays(grid).valid
    np.testing.assert_array_equal(valid_mask(FISHEYE, None), green)


@needs_opengl
@pytest.mark.parametrize(
    ("backend", "degradation"),
    [("cube", Degradation(shutter=Shutter(exposure_s=0.03))), ("rays", Degradation())],
)
def test_channels_are_those_of_three_cameras(backend, degradation):
    """And what is valid is what the green one sees."""
    chromatic = OmniCamera(FISHEYE, degradation=degradation, supersampling=2)

    def motion(time_s):
        return pose(
            (0.3 * time_s, 0.2, 0.1), roll_deg=2.0, pitch_deg=-4.0, yaw_deg=30.0 + 20.0 * time_s
        )

    frames = []
    for sensor in (
        chromatic,
        *(dataclasses.replace(chromatic, model=one) for one in FISHEYE.by_color()),
    ):
        with open_sensor(scene_of([room()]), sensor, backend=backend) as renderer:
            frames.append(renderer.render(motion(0.0), linear=True, motion=motion, also=("range",)))
    ours, *channels = frames
    np.testing.assert_array_equal(ours.valid, channels[1].valid)
    np.testing.assert_array_equal(ours.channels["range"], channels[1].channels["range"])
    assert not ours.rgb[~ours.valid].any()
    assert 0.3 < ours.valid.mean() < 0.9
    for channel, one in enumerate(channels):
        both = ours.valid & one.valid
        found, expected = (np.repeat(f.linear[..., channel, None], 3, 2) for f in (ours, one))
        assert psnr_db(found, expected, both) > 45.0  # virtual cameras have tiles for all three
    red, blue = channels[0].linear[ours.valid], channels[2].linear[ours.valid]
    assert np.abs(red - blue).max() > 0.002


def test_files():
    table = FISHEYE.parameters()
    assert parse_optics(table).chromatic
    assert parse_optics(table).parameters() == table
    with pytest.raises(
        SensorFileError, match=r"a\.toml: color: expected none, as chromatic is true"
    ):
        parse_optics(table | {"color": "R"}, "a.toml")
    with pytest.raises(SensorFileError, match=r"a\.toml: chromatic: expected true or false, got 1"):
        parse_optics(table | {"chromatic": 1}, "a.toml")
    with pytest.raises(OpticsError, match="color: expected none"):
        dataclasses.replace(FISHEYE, color="R")
    assert not any(system.chromatic for system in ALL.values())


@needs_opengl
def test_an_equidistant_lens_keeps_its_circle():
    """The lens's own edge is that of all three colors."""
    lens = EquidistantCamera(60, 60, 20.0, (29.5, 29.5), 1.2)
    system = dataclasses.replace(CHROMATIC, camera=lens)
    with open_sensor(scene_of([room()]), OmniCamera(system)) as renderer:
        frame = renderer.render(pose((0.2, 0.1, 0.0)))
    assert frame.rgb[frame.valid].min() > 10
