"""Cameras and other sensors in a simulator that you already run: it moves, omnisim draws.

with omnisim.follow.MujocoStage(model, data) as stage:
    camera = stage.open("fisheye.toml", vehicle="head")
    while data.time < 1.0:
        mujoco.mj_step(model, data)
        frame = camera.render(stage.now(), also=("range", "instance"))

Of any simulator: `BodyStage` follows arrays of positions and quaternions. Of a known one:
`MujocoStage`, `NewtonStage`, `SapienStage`, `PyBulletStage`, `GenesisStage`; of a recording, such
as Gazebo's: `BagStage`. `CameraWrapper` adds a camera to a Gymnasium environment,
`ManiSkillWrapper` to one of ManiSkill.
"""

from omnisim.core.lazy_names import lazy_names

TYPE_CHECKING = False
if TYPE_CHECKING:
    from omnisim.follow.bag_stage import BagStage
    from omnisim.follow.body_shapes import Shape, shape_scene
    from omnisim.follow.body_stage import BodyStage
    from omnisim.follow.camera_wrapper import CameraWrapper
    from omnisim.follow.genesis_stage import GenesisStage
    from omnisim.follow.maniskill_wrapper import ManiSkillWrapper
    from omnisim.follow.mujoco_stage import MujocoStage
    from omnisim.follow.newton_stage import NewtonStage
    from omnisim.follow.pybullet_stage import PyBulletStage
    from omnisim.follow.sapien_stage import SapienStage

_MODULES = {
    "BagStage": "bag_stage",
    "BodyStage": "body_stage",
    "CameraWrapper": "camera_wrapper",
    "GenesisStage": "genesis_stage",
    "ManiSkillWrapper": "maniskill_wrapper",
    "MujocoStage": "mujoco_stage",
    "NewtonStage": "newton_stage",
    "PyBulletStage": "pybullet_stage",
    "SapienStage": "sapien_stage",
    "Shape": "body_shapes",
    "shape_scene": "body_shapes",
}
__all__ = [
    "BagStage", "BodyStage", "CameraWrapper", "GenesisStage", "ManiSkillWrapper", "MujocoStage",
    "NewtonStage", "PyBulletStage", "SapienStage", "Shape", "shape_scene",
]  # fmt: skip
__getattr__ = lazy_names(__name__, _MODULES)
