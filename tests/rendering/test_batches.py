"""Batches of images and ground truth: byte for byte the single frames, in any slices and arrays."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera
from omnisim.core.errors import GraphicsError, OmnisimError
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.channels import FLOWS
from omnisim.ground_truth.hits import NO_DETAILS
from omnisim.rendering.camera.degradations import Degradation, Noise
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl import buffers, framebuffers
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass
from omnisim.rendering.stage import Stage
from omnisim.scene.model import Light, Lighting, LightKind
from tests.rendering.frames import assert_batch_is_frames
from tests.rendering.opengl.sheets import mixed_scene
from tests.scenes import room, scene_of

pytestmark = pytest.mark.usefixtures("needs_opengl")

SIZE_PX = 60
PAPER = OmniCamera().resized(SIZE_PX)
FISHEYE = OmniCamera(EquidistantCamera(72, 40, 22.0, (35.5, 19.5), theta_max_rad=1.5))
CAMERAS = {
    "fast": PAPER.with_quality("fast"),
    "several samples": dataclasses.replace(PAPER, samples=4),
    "fisheye": FISHEYE,
}
NAMES = tuple(
    name
    for name, channel in CHANNELS.items()
    if name not in {*FLOWS.values()} and not channel.other
)


def _poses(count, camera=PAPER):
    return np.stack(
        [
            camera.base_pose((0.3 * number - 0.7, 0.2 * number, 0.8), yaw_deg=37.0 * number)
            for number in range(count)
        ]
    )


@pytest.fixture(scope="module")
def stage():
    with Stage(mixed_scene()) as stage:
        yield stage


@pytest.fixture
def renderer(stage):
    with stage.open(PAPER) as renderer:
        yield renderer


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
def test_images_are_those_of_single_frames(stage, camera, monkeypatch):
    with stage.open(camera) as renderer:
        batch = assert_batch_is_frames(renderer, _poses(5, camera), ("rgba",))["rgba"]
        assert len({image.tobytes() for image in batch}) == 5
        monkeypatch.setattr(renderer._passes.batches, "slice_length", 2)
        images = renderer.render_batch(_poses(5, camera))
        np.testing.assert_array_equal(images, batch[..., :3])


def test_slices_bound_the_memory(stage, monkeypatch):
    monkeypatch.setattr(buffers, "MAX_SLICE_BYTES", 1 << 20)
    with stage.open(PAPER) as renderer:
        renderer.render_batch(_poses(9))
        batches = renderer._passes.batches
        atlases = batches._reserved.layers.atlases
        texels = atlases.width * atlases.height * atlases.layers
        assert 1 <= batches.slice_length < 9
        assert 8 * texels <= 1 << 20 or batches.slice_length == 1


@pytest.mark.parametrize("names", [NAMES, ("range",), ("albedo", "instance")])
def test_channels_drawn_together_are_those_of_single_frames(renderer, names, monkeypatch):
    drawn, render = list[int](), VisibilityPass.render
    with monkeypatch.context() as counted:

        def render_all(self, poses, details):
            drawn.append(len(poses))
            render(self, poses, details)

        counted.setattr(VisibilityPass, "render", render_all)
        renderer.render_batch(_poses(5), channels=names)
    assert drawn == [5]  # none is drawn alone
    batch = assert_batch_is_frames(renderer, _poses(5), names)
    assert len({values.tobytes() for values in batch[names[0]]}) == 5
    monkeypatch.setattr(buffers, "MAX_SLICE_BYTES", 3 << 20)
    with renderer._stage.open(PAPER) as other:
        sliced = other.render_batch(_poses(5), channels=names)
        assert 1 <= other._passes.hit_source(NO_DETAILS).slice_length() < 5
    for name in names:
        np.testing.assert_array_equal(sliced[name], batch[name])


def test_flows_are_those_of_single_frames(renderer):
    poses, following = _poses(3), _poses(4)[1:]
    names = ("range", "flow", "flow_backward")
    batch = renderer.render_batch(
        poses, channels=("rgb", *names), next_states=following, previous_states=poses[::-1]
    )
    for number, (now, then, before) in enumerate(zip(poses, following, poses[::-1], strict=True)):
        frame = renderer.render(now, also=names, next_state=then, previous_state=before)
        assert batch.keys() == {"rgb", *frame.channels}
        np.testing.assert_array_equal(batch["rgb"][number], frame.rgb)
        for name, values in frame.channels.items():
            assert batch[name].dtype == values.dtype
            np.testing.assert_array_equal(batch[name][number], values, err_msg=name)


def test_objects_are_where_each_state_has_them_and_edits_show():
    with Stage(mixed_scene(), mixed_scene(), dynamic_objects={"other": mixed_scene()}) as stage:
        states = [
            WorldState({"body": one, "other": pose((2.0, 0.1 * number, 0.2))}, 0.1 * number)
            for number, one in enumerate(_poses(3))
        ]
        with stage.open(PAPER) as renderer:
            names = ("rgb", "range", "normals", "instance")
            before = assert_batch_is_frames(renderer, states, names)
            stage.scene = dataclasses.replace(stage.scene, instances=stage.scene.instances[1:])
            edited = assert_batch_is_frames(renderer, states, names)
            assert not np.array_equal(edited["range"], before["range"])


def test_a_body_moves_with_its_poses():
    with Stage(scene_of([room()]), mixed_scene()) as stage, stage.open(PAPER) as renderer:
        poses = _poses(2)
        for form in (poses, list(poses), poses.tolist()):
            assert_batch_is_frames(renderer, form)


def test_cameras_of_a_stage_are_drawn_together(stage):
    poses = _poses(3)
    with stage.open(PAPER) as mirror, stage.open(FISHEYE) as lens:
        pending = [one.begin_batch(poses) for one in (mirror, lens, mirror)]
        images = [one.result()["rgb"] for one in pending]
        np.testing.assert_array_equal(images[0], images[2])
        np.testing.assert_array_equal(images[1], [lens.render(one).rgb for one in poses])
        assert pending[0].result()["rgb"] is images[0]
        unread = mirror.begin_batch(poses)
    with pytest.raises(GraphicsError, match="closed"):
        unread.result()


@pytest.mark.parametrize("camera", ["degraded", "large"])
def test_what_is_not_drawn_together_is_the_same(stage, camera, monkeypatch):
    sensor = dataclasses.replace(PAPER, degradation=Degradation(noise=Noise()))
    if camera == "large":
        monkeypatch.setattr("omnisim.rendering.opengl.capture.image_pass.MAX_TABLE_BYTES", 1000)
        sensor = PAPER
    with stage.open(sensor) as renderer:
        assert renderer._passes.batches is None
        images = renderer.render_batch(_poses(2), frame_number=7)
        for number, one in enumerate(_poses(2)):
            frame = renderer.render(one, frame_number=7 + number)
            np.testing.assert_array_equal(images[number], frame.rgb)


def test_fills_the_callers_arrays_and_other_libraries_take_them_without_a_copy(renderer):
    poses = _poses(2)
    expected = renderer.render_batch(poses, channels=("rgb", "range"))
    rgb = np.empty((2, SIZE_PX, SIZE_PX, 3), np.uint8)
    assert renderer.render_batch(poses, out=rgb) is rgb
    np.testing.assert_array_equal(rgb, expected["rgb"])
    out = {"rgb": np.zeros_like(rgb), "range": np.empty((2, SIZE_PX, SIZE_PX), np.float32)}
    filled = renderer.render_batch(poses, channels=("range", "rgb"), out=out)
    for name, array in out.items():
        assert filled[name] is array
        np.testing.assert_array_equal(array, expected[name])
    part = np.zeros((5, *rgb.shape[1:]), np.uint8)  # rows of a larger array
    renderer.render_batch(poses, out=part[1:3])
    np.testing.assert_array_equal(part[1:3], rgb)
    assert not part[[0, 3, 4]].any()
    images = expected["rgb"]
    assert np.shares_memory(np.from_dlpack(images), images)
    torch = pytest.importorskip("torch", reason="torch is not installed")
    tensor = torch.from_dlpack(images)
    assert tensor.data_ptr() == images.ctypes.data
    renderer.render_batch(poses[::-1].copy(), out=tensor.numpy())
    np.testing.assert_array_equal(tensor.numpy(), rgb[::-1])


RIGHT = np.empty((2, SIZE_PX, SIZE_PX, 3), np.uint8)
LOCKED = RIGHT.copy()
LOCKED.flags.writeable = False
SHAPE = f"of uint8 and shape (2, {SIZE_PX}, {SIZE_PX}, 3)"
POSE = [np.eye(4)]


@pytest.mark.parametrize(
    ("states", "options", "message"),
    [
        (POSE * 2, {"out": RIGHT.tolist()}, f"NumPy array {SHAPE}, got list"),
        (POSE * 2, {"out": RIGHT.astype(np.float32)}, f"{SHAPE}, got type float32"),
        (POSE * 2, {"out": RIGHT[:1]}, f"{SHAPE}, got shape (1, {SIZE_PX}, {SIZE_PX}, 3)"),
        (POSE * 2, {"out": RIGHT[:, ::-1]}, f"{SHAPE}, got one that is not contiguous"),
        (POSE * 2, {"out": LOCKED}, f"{SHAPE}, got a read-only one"),
        (POSE * 2, {"out": {"range": RIGHT}}, "out: expected arrays by name: rgb, got range"),
        (np.eye(4), {}, "poses: expected finite matrices (n, 4, 4), got an array of shape (4, 4)"),
        ([np.eye(4), 2.0 * np.eye(4)], {}, "poses[1]: expected a rotation and a translation"),
        ([np.full((4, 4), np.nan)], {}, "poses[0]: expected a finite 4 × 4 matrix"),
        ("poses", {}, "poses: expected a finite 4 × 4 matrix, got str"),
        (POSE, {"channels": "range"}, "channels 'range': expected a list of names"),
        (POSE, {"channels": ["rgb", "rgba"]}, "expected one of rgb and rgba, got both"),
        (POSE, {"channels": ["depth"]}, "channel 'depth': there is no such channel"),
        (POSE, {"channels": ["flow"]}, "channel 'flow': expected next_states, got none"),
        (POSE, {"channels": ["flow"], "next_states": POSE * 2}, "next_states: expected 1, got 2"),
    ],
)
def test_refuses_impossible_requests(renderer, states, options, message):
    with pytest.raises(OmnisimError) as error:
        renderer.render_batch(states, **options)
    assert message in str(error.value)


def test_an_interrupted_batch_leaves_later_ones_alone(renderer, monkeypatch):
    poses, stale = _poses(3), np.zeros((3, SIZE_PX, SIZE_PX, 3), np.uint8)
    expected = renderer.render_batch(poses)
    passes = renderer._passes
    monkeypatch.setattr(passes.batches, "slice_length", 1)
    draw, drawn = passes.cube.draw, []

    def interrupted(some, *targets):
        if drawn:
            raise KeyboardInterrupt
        drawn.append(some)
        return draw(some, *targets)

    with monkeypatch.context() as patch:
        patch.setattr(passes.cube, "draw", interrupted)
        with pytest.raises(KeyboardInterrupt):
            renderer.render_batch(poses, out=stale)
    np.testing.assert_array_equal(renderer.render_batch(poses), expected)
    assert not stale.any()


@pytest.mark.parametrize("name", ["mapping", "courtyard"])
def test_occlusion_is_that_of_each_camera(name):
    """In `mapping` clusters are tested for occlusion, in the depth of their own camera."""
    with Stage(name) as stage, stage.open(PAPER) as renderer:
        start = stage.scene.start
        poses = np.stack(
            [PAPER.base_pose(start.position_m, yaw_deg=start.yaw_deg + 50.0 * k) for k in range(3)]
        )
        poses[1, 0, 3] += 2.0
        poses[2, 1, 3] += 1.5
        assert_batch_is_frames(renderer, poses)


def test_lamps_are_near_each_camera():
    """Light of a lamp is computed for each fragment, from each camera's own viewpoint."""
    position_m = np.array([0.5, 0.3, 1.2])
    lamp = Light(LightKind.POINT, (1.0, 0.8, 0.5), 6.0, position_m=position_m)
    scene = scene_of([room()], lighting=Lighting(ambient=(0.1, 0.1, 0.1), lights=(lamp,)))
    with Stage(scene) as stage, stage.open(PAPER) as renderer:
        assert assert_batch_is_frames(renderer, _poses(4))["rgb"].max() > 60


def test_layers_drawn_one_after_the_other_are_the_same(renderer, monkeypatch):
    """Some drivers cannot draw them together."""
    names = ("rgb", "range", "normals")
    together = renderer.render_batch(_poses(3), channels=names)
    assert renderer._passes.batches._reserved.layers.drawn is not None
    monkeypatch.setattr(framebuffers, "LAYER_EXTENSIONS", {"GL_NONE_such"})
    for name, values in renderer.render_batch(_poses(3), channels=names).items():
        np.testing.assert_array_equal(values, together[name])


def test_batches_of_other_sizes_are_the_same(renderer):
    """Layers of a larger batch stay, and are not drawn."""
    for count in (6, 4, 1):
        assert_batch_is_frames(renderer, _poses(count))
    assert renderer.render_batch(np.empty((0, 4, 4))).shape == (0, SIZE_PX, SIZE_PX, 3)
