"""ManiSkill: observations have the camera's images, at each step and in a new scene."""

from importlib.util import find_spec

import numpy as np
import pytest

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.core.errors import OmnisimError

for package in ("gymnasium", "mani_skill", "sapien", "torch"):
    if find_spec(package) is None:
        pytest.skip(f"needs {package}", allow_module_level=True)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.usefixtures("needs_opengl"),
    pytest.mark.filterwarnings("ignore"),  # of ManiSkill
]
LENS = EquidistantCamera(96, 96, 29.0, (47.5, 47.5), 1.6)
DOWN = omnisim.pose((0.1, 0.0, 0.0), pitch_deg=-90.0)


@pytest.fixture(params=["none", "pci:0"])
def env(request, monkeypatch):
    """Environment without a renderer, and with one."""
    import gymnasium
    import mani_skill.envs
    from mani_skill.envs.utils.system import backend

    assert mani_skill.envs  # registers the environments
    # ManiSkill 3.0.1 cuts "pci:0", which is Mesa's lavapipe, at its colon
    monkeypatch.setattr(backend, "parse_backend_device_id", lambda name: (name, None))
    try:
        made = gymnasium.make(
            "PickCube-v1", num_envs=1, obs_mode="state", sim_backend="physx_cpu",
            render_backend=request.param,
        )  # fmt: skip
    except RuntimeError as reason:
        pytest.skip(f"ManiSkill needs a Vulkan device: {reason}")
    yield made
    made.close()


def test_observations_have_images_of_the_hand(env):
    from omnisim.follow import ManiSkillWrapper

    channels = ("rgb", "range", "instance")
    wrapped = ManiSkillWrapper(
        env, LENS, vehicle="panda_hand", base_from_sensor=DOWN, channels=channels
    )
    first, _ = wrapped.reset(seed=0)
    images = first["sensor_data"]["omni"]
    assert first["state"].shape == (1, 42)
    assert {name: tuple(image.shape) for name, image in images.items()} == {
        "rgb": (1, 96, 96, 3), "range": (1, 96, 96, 1), "instance": (1, 96, 96, 1),
    }  # fmt: skip
    assert images["rgb"].dtype.itemsize == 1
    space = wrapped.observation_space["sensor_data"]["omni"]
    assert space["range"].shape == (1, 96, 96, 1)
    action = np.ones(wrapped.action_space.shape, np.float32)
    for _ in range(5):
        second = wrapped.step(action)[0]["sensor_data"]["omni"]
    assert (second["rgb"] != images["rgb"]).any()
    stage = wrapped.stage
    seen = {owner for owner in stage.names if "goal" in owner and owner in stage.objects}
    hidden = stage.objects[seen.pop()].instance_names if seen else ()
    state = stage.now()
    lens = stage.open(LENS, DOWN, vehicle="panda_hand", hidden=hidden)
    alone = lens.render(state, also=("range",))
    np.testing.assert_array_equal(second["rgb"][0].numpy(), alone.rgb)  # and not the goal
    wrapped.reset(options={"reconfigure": True})
    assert wrapped.stage is not stage
    wrapped.close()


def test_other_environments_and_keys_in_use_are_one_line(env):
    import gymnasium

    from omnisim.follow import ManiSkillWrapper

    with pytest.raises(OmnisimError, match="env: expected an environment of ManiSkill, got Cart"):
        ManiSkillWrapper(gymnasium.make("CartPole-v1"))
    env.unwrapped._init_raw_obs = {"sensor_data": {"omni": {}}}
    with pytest.raises(OmnisimError, match="key = 'omni': the environment has a camera of this"):
        ManiSkillWrapper(env)
