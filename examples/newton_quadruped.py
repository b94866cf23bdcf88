"""Fisheye beside a quadruped that falls on its feet in Newton: python newton_quadruped.py [FOLDER].

It needs `pip install 'omnisim-camera[newton]'`. Images and range maps go into the folder.
"""

import sys
from pathlib import Path

import newton
import warp as wp

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.follow import NewtonStage

ROBOT = Path(newton.__file__).parent / "examples" / "assets" / "quadruped.urdf"
STEP_S, STANCE = 1e-3, (0.2, 0.4, -0.6, -0.2, -0.4, 0.6, -0.2, 0.4, -0.6, 0.2, -0.4, 0.6)


def main(folder: Path) -> None:
    builder = newton.ModelBuilder()
    builder.default_joint_cfg = builder.JointDofConfig(target_ke=2e3, target_kd=1.0, armature=0.01)
    start = wp.transform((0.0, 0.0, 0.7), wp.quat_identity())
    builder.add_urdf(
        str(ROBOT), xform=start, floating=True, enable_self_collisions=False,
        ignore_inertial_definitions=True, joint_damping_mode="drive",
    )  # fmt: skip
    builder.joint_q[-12:] = builder.joint_target_q[-12:] = STANCE
    builder.add_ground_plane(color=(0.4, 0.5, 0.4))
    model = builder.finalize()
    newton.eval_fk(model, model.joint_q, model.joint_qd, model)
    solver, pipeline = newton.solvers.SolverXPBD(model), newton.CollisionPipeline(model)
    state, after, control = model.state(), model.state(), model.control()
    contacts = pipeline.contacts()
    lens = EquidistantCamera(240, 240, 70.0, (119.5, 119.5), 1.66)
    there = omnisim.pose((0.7, -0.6, 0.5), yaw_deg=140.0, pitch_deg=10.0)
    with NewtonStage(model) as stage:
        camera = stage.open(lens, there)  # with vehicle="base" on the robot
        for number in range(4):
            frame = camera.render(stage.now(state, 0.1 * number), also=("range",))
            frame.save(folder / f"{number}.png")
            height_m = float(state.body_q.numpy()[0, 2])
            print(f"{0.1 * number:.1f} s: the base is {height_m:.2f} m above the ground")
            for _ in range(100):
                state.clear_forces()
                pipeline.collide(state, contacts)
                solver.step(state, after, control, contacts, STEP_S)
                state, after = after, state


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
