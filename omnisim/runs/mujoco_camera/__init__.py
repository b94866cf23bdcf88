"""Cameras of omnisim in your own MuJoCo simulation loop; needs the extra `mujoco`.

with omnisim.runs.mujoco_camera.Camera(model, data, "fisheye.toml", body="head") as camera:
    while data.time < 1.0:
        mujoco.mj_step(model, data)
        frame = camera.render(also=("range", "instance"))
"""

from typing import TYPE_CHECKING

from omnisim.runs.mujoco_camera.simulated_camera import NO_GEOM, VISIBLE_GROUPS, Camera

if TYPE_CHECKING:
    from omnisim.scene.formats.mjcf.reader import lens_of

__all__ = ["NO_GEOM", "VISIBLE_GROUPS", "Camera", "lens_of"]


def __getattr__(name: str) -> object:
    if name == "lens_of":
        from omnisim.scene.formats.mjcf.reader import lens_of  # needs the extra

        return lens_of
    raise AttributeError(f"module 'omnisim.runs.mujoco_camera' has no attribute {name!r}")
