"""Cameras and other sensors in a simulator that you already run: it moves, omnisim draws.

with omnisim.follow.MujocoStage(model, data) as stage:
    camera = stage.open("fisheye.toml", vehicle="head")
    while data.time < 1.0:
        mujoco.mj_step(model, data)
        frame = camera.render(stage.now(), also=("range", "instance"))

Of any simulator: `BodyStage` follows arrays of positions and quaternions. Of a known one:
`MujocoStage`, `NewtonStage`, `SapienStage`, `PyBulletStage`, `GenesisStage`; of a recording:
`GazeboStage`. `CameraWrapper` adds a camera to a Gymnasium environment.
"""

from omnisim.core.lazy_names import lazy_names

TYPE_CHECKING = False
if TYPE_CHECKING:
    from omnisim.follow.body_shapes import Shape, shape_scene
    from omnisim.follow.body_stage import BodyStage
    from omnisim.follow.maniskill_wrapper import ManiSkillWrapper
    from omnisim.follow.pybullet_stage import PyBulletStage
    from omnisim.follow.sapien_stage import SapienStage

_MODULES = {
    "BodyStage": "body_stage",
    "ManiSkillWrapper": "maniskill_wrapper",
    "PyBulletStage": "pybullet_stage",
    "SapienStage": "sapien_stage",
    "Shape": "body_shapes",
    "shape_scene": "body_shapes",
}
__all__ = ["BodyStage", "ManiSkillWrapper", "PyBulletStage", "SapienStage", "Shape", "shape_scene"]
__getattr__ = lazy_names(__name__, _MODULES)
