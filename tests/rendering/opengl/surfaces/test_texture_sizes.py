"""Textures of more sizes than a shader has samplers, beside instances drawn one after the other."""

import numpy as np
import pytest

from omnisim.core.poses import pose as make_pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.scene.model import AlphaMode, Lighting, Material, Texture, Wrap
from tests.rendering.opengl.sheets import SUN, sheet
from tests.rendering.opengl.surfaces.test_cluster_drawer import assert_same, reference_stage
from tests.scenes import room, scene_of

pytestmark = pytest.mark.usefixtures("needs_opengl")

CAMERA = OmniCamera().with_quality("fast").resized(160)
COUNT = 40
CHANNELS = ("range", "instance", "albedo")
POSES = [make_pose((0.1 * n, 0.2 - 0.2 * n, -0.3), yaw_deg=80.0 * n) for n in range(3)]


def _texture(number, is_linear=False):
    """Texture of a size that no other has."""
    shape = (5 + number, 70 - number, 4)
    pixels = np.random.default_rng(number).integers(40, 256, shape, dtype=np.uint8)
    wrap = (Wrap.REPEAT, Wrap.CLAMP_TO_EDGE)[number % 2]
    return Texture(pixels, wrap, wrap, is_linear=is_linear)


def _opaque(number):
    return Material(texture=_texture(number))


def _masked(number):
    texture = _texture(number)
    texture.pixels[..., 3] = 255
    texture.pixels[: len(texture.pixels) // 3, :, 3] = 0
    return Material(texture=texture, alpha_mode=AlphaMode.MASK, double_sided=True)


def _blended(number):
    return Material(
        (0.8, 0.8, 0.9, 0.7), texture=_texture(number), alpha_mode=AlphaMode.BLEND,
        double_sided=True, unlit=number % 3 == 0,
    )  # fmt: skip


def _glossy(number):
    return Material(
        texture=_texture(number), roughness=0.3, metallic=1.0,
        metallic_roughness_map=_texture(number + COUNT // 2, is_linear=True),
    )  # fmt: skip


def _scene(make_material):
    """Sheets about the camera, each with a texture of its own size."""
    generator = np.random.default_rng(3)
    meshes, poses = [room()], [np.eye(4)]
    for number in range(COUNT):
        meshes.append(sheet(f"sheet {number}", 1 + number, side=4, seed=number, up=0.8))
        at = generator.uniform((-2.5, -1.6, -1.2), (2.5, 1.6, 0.6))
        at *= max(1.0, 1.0 / np.linalg.norm(at))
        roll_deg, pitch_deg, yaw_deg = generator.uniform(0.0, 360.0, 3)
        poses.append(make_pose(at, roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg))
    materials = [Material("room", double_sided=True), *map(make_material, range(COUNT))]
    lighting = Lighting((0.2, 0.2, 0.3), (SUN,))
    return scene_of(meshes, materials, poses, lighting=lighting)


@pytest.mark.parametrize(
    "make_material",
    [_masked, _blended, *(pytest.param(f, marks=pytest.mark.slow) for f in (_opaque, _glossy))],
)
def test_forty_sizes_look_as_if_drawn_one_by_one(make_material, monkeypatch):
    scene = _scene(make_material)
    poses = np.stack([one @ np.linalg.inv(CAMERA.base_from_rig) for one in POSES])
    with (
        Stage(scene) as stage,
        reference_stage(monkeypatch, scene) as reference,
        stage.open(CAMERA) as renderer,
        reference.open(CAMERA) as one_by_one,
    ):
        frames = [renderer.render(one, also=CHANNELS) for one in poses]
        batch = renderer.render_batch(poses, channels=("rgba", *CHANNELS))
        for frame, pose in zip(frames, poses, strict=True):
            assert_same(frame.rgba, one_by_one.render(pose).rgba)
    np.testing.assert_array_equal(batch["rgba"], [frame.rgba for frame in frames])
    for name in CHANNELS:
        np.testing.assert_array_equal(batch[name], [frame.channels[name] for frame in frames])
    assert len(np.unique(batch["instance"])) > COUNT // 2
