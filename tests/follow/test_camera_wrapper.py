"""Gymnasium environments with a camera: observations fit their spaces, and show the state."""

import numpy as np
import pytest

from omnisim import pose
from omnisim.cameras import EquidistantCamera
from omnisim.core.errors import OmnisimError
from omnisim.follow import BodyStage, MujocoStage, Shape, shape_scene
from omnisim.scene import primitives

gymnasium = pytest.importorskip("gymnasium")
mujoco = pytest.importorskip("mujoco")
from gymnasium.utils.env_checker import check_env  # noqa: E402

from omnisim.follow import CameraWrapper  # noqa: E402

pytestmark = pytest.mark.usefixtures("needs_opengl")
LENS = EquidistantCamera(32, 24, 12.0, (15.5, 11.5), 1.5)
CART = """
<mujoco><worldbody>
  <light pos="0 0 4"/><geom type="plane" size="4 4 .1"/>
  <geom type="box" size=".1 2 1" pos="3 0 1" rgba=".8 .2 .1 1"/>
  <body name="cart" pos="0 0 .2"><joint name="drive" type="slide" axis="1 0 0"/>
    <geom type="box" size=".2 .2 .1"/><site name="head" pos="0 0 .3"/></body>
</worldbody></mujoco>
"""


class Cart(gymnasium.Env):
    """Cart of MuJoCo whose speed is the action."""

    metadata = {"render_modes": []}  # noqa: RUF012  # Gymnasium's own name and type

    def __init__(self, is_dict=False):
        self.model = mujoco.MjModel.from_xml_string(CART)
        self.data = mujoco.MjData(self.model)
        self.is_dict = is_dict
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        box = gymnasium.spaces.Box(-100.0, 100.0, (1,), np.float64)
        self.observation_space = gymnasium.spaces.Dict({"x": box}) if is_dict else box

    def _observe(self):
        mujoco.mj_forward(self.model, self.data)
        return {"x": self.data.qpos.copy()} if self.is_dict else self.data.qpos.copy()

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[0] = self.np_random.uniform(-0.5, 0.5)
        return self._observe(), {}

    def step(self, action):
        self.data.qpos[0] += 0.1 * float(action[0])
        return self._observe(), 0.0, False, False, {}


gymnasium.register("omnisim-test/Cart-v0", entry_point=Cart, max_episode_steps=20)


@pytest.mark.filterwarnings("ignore::UserWarning")  # that it is wrapped, and infinite bounds
def test_an_environment_with_images_passes_gymnasiums_check():
    env = CameraWrapper(
        gymnasium.make("omnisim-test/Cart-v0"), LENS, vehicle="site/head",
        channels=("rgb", "range", "instance", "normals"),
    )  # fmt: skip
    check_env(env)
    shapes = {key: (space.shape, space.dtype) for key, space in env.observation_space.items()}
    assert shapes == {
        "observation": ((1,), np.float64),
        "omni": ((24, 32, 3), np.uint8),
        "omni_range": ((24, 32), np.float32),
        "omni_instance": ((24, 32), np.uint32),
        "omni_normals": ((24, 32, 3), np.float32),
    }
    assert env.observation_space["omni_range"].low.min() == 0.0
    env.close()
    env.close()
    again = env.spec.make()
    assert isinstance(again, CameraWrapper)
    again.close()


def test_images_are_of_the_present_state():
    with CameraWrapper(
        Cart(is_dict=True), LENS, vehicle="site/head", key="eye", channels=("range", "rgb")
    ) as env:
        first, _ = env.reset(seed=1)
        assert set(first) == {"x", "eye", "eye_range"}
        second, *_ = env.step(np.array([1.0], np.float32))
        ahead = [seen["eye_range"][10:13, 14:18] for seen in (first, second)]
        assert ahead[0] - ahead[1] == pytest.approx(np.full((3, 4), 0.1), abs=0.01)  # of a wall
        assert env.observation_space.contains(second)
        assert isinstance(env.stage, MujocoStage)
        again, _ = env.reset(seed=1)
        assert (again["eye"] == first["eye"]).all()


class Buoy(gymnasium.Env):
    """Environment of no known simulator: a height."""

    action_space = observation_space = gymnasium.spaces.Box(-9.0, 9.0, (1,), np.float32)
    height_m = 0.0

    def reset(self, *, seed=None, options=None):
        self.height_m = 0.0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.height_m += float(action[0])
        return np.array([self.height_m], np.float32), 0.0, False, False, {}


class BuoyStage(BodyStage):
    """Stage of a buoy."""

    def __init__(self, env):
        self._env = env
        floor = shape_scene("", [Shape(primitives.rectangle(9.0, 9.0))])
        super().__init__(floor, names=["buoy"])

    def now(self):
        return self.state([(0.0, 0.0, self._env.height_m)], [(1.0, 0.0, 0.0, 0.0)])


def test_other_environments_bring_their_stage():
    down = pose((0.0, 0.0, 1.0), pitch_deg=90.0)
    with CameraWrapper(
        Buoy(), LENS, base_from_sensor=down, vehicle="buoy", channels=("range",), stage=BuoyStage
    ) as env:
        env.reset()
        seen, *_ = env.step(np.array([2.0], np.float32))
        assert seen["omni_range"][12, 16] == pytest.approx(3.0, abs=0.05)


@pytest.mark.parametrize(
    ("env", "options", "message"),
    [
        (Buoy, {}, "stage: expected a function, as Buoy has no MuJoCo model, got None"),
        (Cart, {"key": "observation"}, "key = 'observation': the observation has 'observation'"),
        (Cart, {"channels": ()}, "channels: expected one at least, got none"),
        (Cart, {"channels": ("rangee",)}, "channel 'rangee': there is no such channel"),
        (Cart, {"channels": ("flow",)}, "channels: 'flow' needs the next frame, which no"),
        (Cart, {"channels": ("position",)}, "channels: 'position' has NaN without a hit, which no"),
        (Cart, {"vehicle": "cat"}, "vehicle = 'cat': did you mean 'cart'"),
    ],
)
def test_what_does_not_fit_is_named(env, options, message):
    with pytest.raises(OmnisimError, match=message):
        CameraWrapper(env(), LENS, **options)
