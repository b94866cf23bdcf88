"""Wrapper that adds a camera's images to the observations of ManiSkill's environments."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.errors import OmnisimError
from omnisim.core.extras import is_installed
from omnisim.follow.sapien_stage import SapienStage
from omnisim.rendering.camera.omnicamera import CameraLike, OmniCamera
from omnisim.rendering.shared_scene import BackendName

if not is_installed("mani_skill"):  # which brings gymnasium, SAPIEN and torch
    raise OmnisimError("ManiSkillWrapper needs ManiSkill: pip install mani_skill")
import gymnasium  # after the message of what is missing


class ManiSkillWrapper(gymnasium.ObservationWrapper[dict[str, Any], Any, Any]):
    """ManiSkill environment whose observations have a camera's images of all `num_envs` worlds.

    As those of ManiSkill's own cameras, they are in `observation["sensor_data"][key]`: `rgb`
    (num_envs, height, width, 3) uint8, and other channels, (num_envs, height, width, layers), as
    tensors on the environment's device. An observation that is no dict becomes its `state`. What
    ManiSkill hides from its cameras, such as goals, is hidden.

    Args:
        env: an environment of ManiSkill, as `gymnasium.make` makes it, of any observations. With
            `render_backend="none"` omnisim draws collision shapes.
        sensor: the camera, as for `omnisim.Stage.open`.
        vehicle: link or actor that carries it, as `panda_hand`; None: fixed to the world.
        base_from_sensor: (4, 4) mount, x forward.
        key: name of the camera.
        channels: "rgb", and channels of ground truth that need no other frame.
        device, backend: as for `omnisim.Stage`.

    Attributes:
        stage: the stage; a new one where the environment is reconfigured.

    Raises:
        OmnisimError: no ManiSkill, no environment of it, a key that is in use, or as for
            `SapienStage` and `Stage.open`.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        sensor: CameraLike = None,
        *,
        vehicle: str | None = None,
        base_from_sensor: ArrayLike | None = None,
        key: str = "omni",
        channels: Sequence[str] = ("rgb",),
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        super().__init__(env)
        self._base = cast("Any", env.unwrapped)
        if not hasattr(self._base, "scene") or not hasattr(self._base.scene, "sub_scenes"):
            kind = type(self._base).__name__
            raise OmnisimError(f"env: expected an environment of ManiSkill, got {kind}")
        self._sensor, self._key, self._channels = OmniCamera.of(sensor), key, tuple(channels)
        self._vehicle, self._base_from_sensor = vehicle, base_from_sensor
        self._options: dict[str, Any] = {"device": device, "backend": backend}
        self._number = 0
        first = self._base._init_raw_obs
        if isinstance(first, dict) and key in first.get("sensor_data", ()):
            raise OmnisimError(f"key = {key!r}: the environment has a camera of this name")
        self._open()
        try:
            self._base.update_obs_space(self.observation(first))
        except BaseException:
            self.stage.close()
            raise

    def _open(self) -> None:
        self._scene = self._base.scene
        self.stage = SapienStage(self._scene, **self._options)
        hidden = {entity.name for actor in self._base._hidden_objects for entity in actor._objs}
        shapes = [self.stage.objects[name] for name in hidden & self.stage.objects.keys()]
        names = [name for shape in shapes for name in shape.instance_names]
        try:
            self._camera = self.stage.open(
                self._sensor, self._base_from_sensor, hidden=names, vehicle=self._vehicle
            )
        except BaseException:
            self.stage.close()
            raise

    def observation(self, observation: Any) -> dict[str, Any]:
        """Observation with the images of the present state."""
        torch = importlib.import_module("torch")
        if self._base.scene is not self._scene:  # reconfigured
            self.stage.close()
            self._open()
        states = self.stage.worlds_now()
        arrays = self._camera.render_batch(
            states, channels=self._channels, frame_number=self._number
        )
        self._number += len(states)
        images = {
            name: torch.from_numpy(array if array.ndim == 4 else array[..., np.newaxis])
            for name, array in arrays.items()
        }
        images = {name: image.to(self._base.device) for name, image in images.items()}
        own = observation if isinstance(observation, dict) else {"state": observation}
        return {**own, "sensor_data": {**own.get("sensor_data", {}), self._key: images}}

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Reset the environment; seeds start the camera's noise anew, too."""
        if seed is not None:
            self._number = 0
        return super().reset(seed=seed, options=options)

    def close(self) -> None:
        """Free the stage's memory, and close the environment; a second call does nothing."""
        self.stage.close()
        super().close()
