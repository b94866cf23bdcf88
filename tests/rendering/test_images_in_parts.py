"""Images, ground truth and degradations drawn in parts, beside those drawn whole.

Parts sample the same texels. Their virtual cameras have other projection matrices, though, whose
rounding moves edges of triangles by a part of a texel, and colors by a part of a step of 8 bits.
"""

import dataclasses

import numpy as np
import pytest

from omnisim import OmniCamera, Stage, open_sensor
from omnisim.cameras import EquidistantCamera, EquirectangularCamera
from omnisim.core.errors import GraphicsError
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.channels import FLOWS
from omnisim.rendering.atlas import image_parts, parallax_plan
from omnisim.rendering.atlas.parallax_plan import sample_rays
from omnisim.rendering.camera.degradations import Degradation, PointSpread, Shutter
from omnisim.rendering.opengl.capture import image_pass
from tests.cameras.optics.examples import SYSTEMS
from tests.rendering.opengl.sheets import dynamic_object, mixed_scene
from tests.scenes import room, scene_of
from tests.slow import slow_but

pytestmark = pytest.mark.usefixtures("needs_opengl")

FISHEYE = EquidistantCamera(128, 128, 38.4, (63.5, 63.5), theta_max_rad=1.66)
CAMERAS = {
    "exact mirror": OmniCamera(polygons=None).resized(128),
    "mesh": OmniCamera(polygons=64).resized(128),
    "fisheye": OmniCamera(FISHEYE),
    "equirectangular": OmniCamera(EquirectangularCamera(160, 80)),
    "one sample, mip levels": OmniCamera(FISHEYE, supersampling=1, texels_per_pixel=3.0),
    "four samples per texel": OmniCamera(FISHEYE, samples=4, texels_per_pixel=2.0),
}
EDGES, STEPS = 1e-3, 0.03  # shares of pixels that differ by more than one step of 8 bits, by one
OF_HITS = 2e-4  # share of pixels whose hit a texel at an edge of two triangles decides
TEXTURED = ("albedo", "roughness", "metallic", "emissive")
CHANNELS_OF_NEXT = ("flow", "occluded", "scene_flow", "normals", "albedo", "instance", "range")


@pytest.fixture(scope="module")
def stage():
    with Stage(mixed_scene(), dynamic_objects={"cart": dynamic_object()}) as stage:
        yield stage


@pytest.fixture
def whole_and_parts(monkeypatch):
    """Function that takes something whole, and then with limits that cut the image."""

    def taken(take, part_px=448):
        whole = take()
        with monkeypatch.context() as lowered:
            lowered.setattr(image_parts, "MAX_TEXELS", 1 << 14)
            lowered.setattr(image_parts, "PART_PX", part_px)
            return whole, take()

    return taken


def _state(camera, number=0):
    base = camera.base_pose((0.1 * number - 0.3, 0.2, 0.4), yaw_deg=20.0 + 9.0 * number)
    return WorldState({"body": base, "cart": pose((0.2, 0.1 * number, 0.0), yaw_deg=30.0)})


def _assert_alike(whole, parts, edges=EDGES, steps=STEPS):
    assert whole[..., 0].std() > 20.0  # there is much to see
    assert np.array_equal(whole[..., 3], parts[..., 3])
    differ = np.abs(whole.astype(int) - parts).max(axis=-1)
    assert (differ > 1).mean() <= edges
    assert (differ > 0).mean() <= steps


@pytest.mark.parametrize("name", slow_but(CAMERAS, "mesh", "equirectangular", *list(CAMERAS)[-2:]))
def test_an_image_in_parts_is_the_whole_image(stage, name, whole_and_parts):
    counts, camera = [], CAMERAS[name]

    def take():
        with stage.open(camera) as renderer:
            counts.append(len(renderer._passes.frame._parts))
            return renderer.render(_state(camera)).rgba

    _assert_alike(*whole_and_parts(take))
    assert counts[0] == 1 < counts[1]


@pytest.mark.parametrize("name", ["exact mirror", "equirectangular"])
def test_ground_truth_in_parts_is_that_of_the_whole(stage, name, whole_and_parts):
    camera = CAMERAS[name]
    others = [one for one in CHANNELS if one not in CHANNELS_OF_NEXT and not CHANNELS[one].other]
    others = [other for other in others if other not in FLOWS.values()]

    def take():
        with stage.open(camera) as renderer:
            frame = renderer.render(_state(camera), also=others)
            next_frame = renderer.render(
                _state(camera), also=CHANNELS_OF_NEXT, next_state=_state(camera, 1)
            )
            assert (len(renderer._passes._hit_source._passes.parts) > 1) == bool(counts)
            counts.append(1)
            return frame.channels | next_frame.channels

    counts = []
    whole, parts = whole_and_parts(take, 320)
    assert whole.keys() == parts.keys()
    for channel, values in whole.items():
        differs = values != parts[channel]
        if np.issubdtype(values.dtype, np.floating):  # textures' are half floats
            step = 1e-3 if channel in TEXTURED else 1e-6
            differs &= ~np.isclose(values, parts[channel], step, step, equal_nan=True)
        assert differs.mean() <= (EDGES if channel in TEXTURED else OF_HITS), channel
    assert 0.02 < (whole["occluded"] == 1).mean() < 0.5


def test_blur_crosses_the_borders_of_parts_and_batches_are_single_images(stage, whole_and_parts):
    effects = Degradation(
        shutter=Shutter(exposure_s=0.02), point_spread=PointSpread(((0.0, 1.5, 1.5),))
    )
    camera = OmniCamera(FISHEYE, degradation=effects)

    def take():
        with stage.open(camera) as renderer:
            image = renderer.render(_state(camera), next_state=_state(camera, 1)).rgba
        with stage.open(OmniCamera(FISHEYE)) as renderer:
            states = [_state(renderer.camera, number) for number in range(2)]
            batch = renderer.render_batch(states, channels=("rgb", "range"))
            for state, rgb, ranges in zip(states, batch["rgb"], batch["range"], strict=True):
                single = renderer.render(state, also=("range",))
                np.testing.assert_array_equal(rgb, single.rgba[..., :3])
                np.testing.assert_array_equal(ranges, single.channels["range"])
        return image

    _assert_alike(*whole_and_parts(take))


def test_edits_of_the_scene_show_in_all_parts(stage, whole_and_parts):
    """The second pose, and new buffers, begin with the parts' first tiles again."""
    camera = CAMERAS["fisheye"]

    def take():
        with stage.open(camera) as renderer:
            before = renderer.render(_state(camera)).rgba
            renderer.render(_state(camera, 3))
            stage.scene = dataclasses.replace(stage.scene)
            np.testing.assert_array_equal(renderer.render(_state(camera)).rgba, before)
            return before

    _assert_alike(*whole_and_parts(take))


def test_parts_without_kept_textures_are_drawn_alike(stage, monkeypatch):
    monkeypatch.setattr(image_parts, "MAX_TEXELS", 1 << 14)
    monkeypatch.setattr(image_parts, "PART_PX", 320)
    camera = CAMERAS["one sample, mip levels"]
    images = []
    for kept_bytes in (1 << 18, 1 << 30):  # some, and all
        monkeypatch.setattr(image_pass, "MAX_KEPT_BYTES", kept_bytes)
        with stage.open(camera) as renderer:
            renderer.render(_state(camera, 1))
            images.append(renderer.render(_state(camera)).rgba)
    np.testing.assert_array_equal(*images)


def test_virtual_cameras_of_any_size(whole_and_parts):
    camera = dataclasses.replace(CAMERAS["mesh"].resized(160), face_size_px=600)

    def take():
        with open_sensor(scene_of([room()]), camera) as renderer:
            return renderer.render(camera.base_pose((0.3, 0.2, 0.1))).rgba

    whole, parts = whole_and_parts(take)
    assert np.abs(whole.astype(int) - parts).max() <= 1
    with pytest.raises(GraphicsError, match=r"texels_per_pixel smaller$"):
        open_sensor(scene_of([room()]), dataclasses.replace(camera, face_size_px=10**7))


def test_an_optical_system_of_too_many_texels_is_refused_before_it_is_traced(monkeypatch):
    system = next(iter(SYSTEMS.values()))
    traced = []

    def recorded(camera, *arguments):
        traced.append(max(camera.width_px, camera.height_px))
        return sample_rays(camera, *arguments)

    monkeypatch.setattr(parallax_plan, "sample_rays", recorded)
    with pytest.raises(GraphicsError, match=r"only central cameras .* fast or --backend rays$"):
        open_sensor(scene_of([room()]), OmniCamera(system).resized(9000))
    assert max(traced) <= 256
