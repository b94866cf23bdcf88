"""Ground truth of batches, drawn together: byte for byte that of single frames."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.channels import FLOWS
from omnisim.ground_truth.hits import NO_DETAILS
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl import buffers, framebuffers
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass
from omnisim.rendering.stage import Stage
from tests.rendering.opengl.sheets import mixed_scene

pytestmark = pytest.mark.usefixtures("needs_opengl")

CAMERA = OmniCamera().resized(60)
NAMES = tuple(
    name for name, one in CHANNELS.items() if name not in {*FLOWS.values()} and not one.other
)


def _poses(count):
    return np.stack(
        [
            CAMERA.base_pose((0.3 * number - 0.7, 0.2 * number, 0.8), yaw_deg=37.0 * number)
            for number in range(count)
        ]
    )


@pytest.fixture(scope="module")
def stage():
    with Stage(mixed_scene()) as stage:
        yield stage


def _assert_same(renderer, batch, states):
    for number, state in enumerate(states):
        for name, values in renderer.render(state, also=tuple(batch)).channels.items():
            np.testing.assert_array_equal(batch[name][number], values, err_msg=name)


@pytest.mark.parametrize("names", [NAMES, ("range",), ("normals",), ("albedo", "instance")])
def test_channels_drawn_together_are_those_of_single_frames(stage, names, monkeypatch):
    with stage.open(CAMERA) as renderer:
        drawn, render = list[int](), VisibilityPass.render
        with monkeypatch.context() as counted:

            def render_all(self, poses, details):
                drawn.append(len(poses))
                render(self, poses, details)

            counted.setattr(VisibilityPass, "render", render_all)
            batch = renderer.render_batch(_poses(5), channels=names)
        assert drawn == [5]  # none is drawn alone
        _assert_same(renderer, batch, _poses(5))
        assert len({values.tobytes() for values in batch[names[0]]}) == 5


def test_slices_are_the_same(stage, monkeypatch):
    with stage.open(CAMERA) as renderer:
        whole = renderer.render_batch(_poses(5), channels=("range", "albedo"))
        monkeypatch.setattr(buffers, "MAX_SLICE_BYTES", 3 << 20)
        assert 2 <= renderer._passes.hit_source(NO_DETAILS).slice_length() < 5
        for name, values in renderer.render_batch(_poses(5), channels=tuple(whole)).items():
            np.testing.assert_array_equal(values, whole[name])


def test_objects_are_where_each_state_has_them():
    body = mixed_scene()
    with Stage(mixed_scene(), body, dynamic_objects={"other": body}) as stage:
        states = [
            WorldState({"body": one, "other": pose((2.0, 0.1 * number, 0.2))}, 0.1 * number)
            for number, one in enumerate(_poses(3))
        ]
        with stage.open(CAMERA) as renderer:
            batch = renderer.render_batch(states, channels=("range", "normals", "instance"))
            _assert_same(renderer, batch, states)


def test_edits_of_the_scene_show(stage):
    with Stage(mixed_scene()) as stage, stage.open(CAMERA) as renderer:
        before = renderer.render_batch(_poses(2), channels=("range",))["range"]
        stage.scene = dataclasses.replace(stage.scene, instances=stage.scene.instances[1:])
        batch = renderer.render_batch(_poses(2), channels=("range",))
        assert not np.array_equal(batch["range"], before)
        _assert_same(renderer, batch, _poses(2))


def test_drivers_without_layers_give_the_same(stage, monkeypatch):
    with stage.open(CAMERA) as renderer:
        together = renderer.render_batch(_poses(3), channels=("range", "normals"))
        monkeypatch.setattr(framebuffers, "LAYER_EXTENSIONS", {"GL_NONE_such"})
        for name, values in renderer.render_batch(_poses(3), channels=tuple(together)).items():
            np.testing.assert_array_equal(values, together[name])
