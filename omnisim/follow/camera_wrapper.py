"""Wrapper that adds a camera's images to the observations of a Gymnasium environment."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.errors import OmnisimError
from omnisim.core.extras import require_extra
from omnisim.follow.body_stage import BodyStage
from omnisim.ground_truth import CHANNELS, check_channels
from omnisim.rendering.camera.omnicamera import CameraLike, OmniCamera

require_extra("gymnasium", "CameraWrapper")
import gymnasium  # noqa: E402  # after the message of what is missing
from gymnasium import spaces  # noqa: E402

RGB = "rgb"


class CameraWrapper(
    gymnasium.ObservationWrapper[dict[str, Any], Any, Any], gymnasium.utils.RecordConstructorArgs
):
    """Environment whose observations have images of a camera beside those that it had.

    Observations are a dict: that of the environment, or {"observation": its observation}, with
    `key`, the image (height, width, 3) uint8, and `key_CHANNEL` for each other channel, (height,
    width) or (height, width, layers).

    Args:
        env: an environment of MuJoCo with `model` and `data`, as Gymnasium's own; or any with
            `stage`.
        sensor: the camera, as for `omnisim.Stage.open`.
        vehicle: body that carries it, as for the stage; None: fixed to the world.
        base_from_sensor: (4, 4) mount on the body, x forward.
        key: key of the image.
        channels: "rgb", and channels of ground truth that need no other frame.
        stage: function that makes the stage, whose `now()` is the state to draw, for an
            environment; the wrapper closes it. None: `MujocoStage` of its model and data.

    Attributes:
        stage: the stage.

    Raises:
        OmnisimError: no MuJoCo, a key that the observation has, a channel that does not fit, or as
            for the stage and `Stage.open`.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        sensor: CameraLike = None,
        *,
        vehicle: str | None = None,
        base_from_sensor: ArrayLike | None = None,
        key: str = "omni",
        channels: Sequence[str] = (RGB,),
        stage: Callable[[gymnasium.Env[Any, Any]], BodyStage] | None = None,
    ):
        gymnasium.utils.RecordConstructorArgs.__init__(
            self, sensor=sensor, vehicle=vehicle, base_from_sensor=base_from_sensor, key=key,
            channels=channels, stage=stage, _disable_deepcopy=True,
        )  # fmt: skip
        super().__init__(env)
        camera = OmniCamera.of(sensor)
        self._channels = check_channels(set(channels) - {RGB})
        keys = {name: f"{key}_{name}" for name in self._channels}
        if RGB in channels:
            keys = {RGB: key, **keys}
        size = (camera.model.height_px, camera.model.width_px)
        own = env.observation_space
        known = dict(own.spaces) if isinstance(own, spaces.Dict) else {"observation": own}
        if not keys:
            raise OmnisimError("channels: expected one at least, got none")
        for entry in keys.values():
            if entry in known:
                raise OmnisimError(f"key = {key!r}: the observation has {entry!r}, too")
        self._keys = keys
        added = {entry: _space(name, size) for name, entry in keys.items()}
        self.observation_space = spaces.Dict({**known, **added})
        self.stage: Any = (stage or _mujoco_stage)(env)  # of a host, with `now`
        self._number = 0
        try:
            self._camera = self.stage.open(camera, base_from_sensor, vehicle=vehicle)
        except BaseException:
            self.stage.close()
            raise

    def observation(self, observation: Any) -> dict[str, Any]:
        """Observation with the images of the present state."""
        frame = self._camera.render(
            self.stage.now(), also=self._channels, frame_number=self._number
        )
        self._number += 1
        is_dict = isinstance(self.env.observation_space, spaces.Dict)
        images = {
            entry: frame.rgb if name == RGB else frame.channels[name]
            for name, entry in self._keys.items()
        }
        return {**(observation if is_dict else {"observation": observation}), **images}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Reset the environment; a seed starts the camera's noise anew, too."""
        if seed is not None:
            self._number = 0
        return super().reset(seed=seed, options=options)

    def close(self) -> None:
        """Free the stage's memory, and close the environment; a second call does nothing."""
        self.stage.close()
        super().close()


def _mujoco_stage(env: gymnasium.Env[Any, Any]) -> BodyStage:
    from omnisim.follow.mujoco_stage import MujocoStage

    inner: Any = env.unwrapped
    model, data = getattr(inner, "model", None), getattr(inner, "data", None)
    if model is None or type(model).__name__ != "MjModel" or data is None:
        name = type(inner).__name__
        raise OmnisimError(f"stage: expected a function, as {name} has no MuJoCo model, got None")
    return MujocoStage(model, data)


def _space(name: str, size: tuple[int, int]) -> spaces.Box:
    """Space of a channel's image."""
    if name == RGB:
        return spaces.Box(0, 255, (*size, 3), np.uint8)
    channel = CHANNELS[name]
    if channel.other or math.isnan(channel.empty):
        reason = f"needs the {channel.other} frame" if channel.other else "has NaN without a hit"
        raise OmnisimError(f"channels: {name!r} {reason}, which no observation can have")
    layers = (len(channel.layers),) if len(channel.layers) > 1 else ()
    dtype = np.dtype(channel.dtype)
    low, high = (-math.inf, math.inf) if dtype.kind == "f" else (0, np.iinfo(dtype).max)
    return spaces.Box(max(low, 0) if "range" in name else low, high, (*size, *layers), dtype.type)
