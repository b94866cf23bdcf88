"""Fisheye on a swinging arm in SAPIEN, which sweeps boxes away: python sapien_fisheye.py [FOLDER].

It needs `pip install 'omnisim-camera[sapien]'`, and no Vulkan: without a renderer omnisim draws
what collides. Images and range maps go into the folder.
"""

import sys
from pathlib import Path

import sapien

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.follow import SapienStage

UPRIGHT = (0.7071068, 0.0, -0.7071068, 0.0)  # x up, about which joints turn


def main(folder: Path) -> None:
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    scene.add_ground(0.0, render=False)
    builder = scene.create_articulation_builder()
    mast = builder.create_link_builder()
    mast.add_box_collision(half_size=(0.1, 0.1, 0.6)).set_name("mast")
    arm = builder.create_link_builder(mast)
    arm.add_box_collision(sapien.Pose((0.4, 0.0, 0.0)), (0.5, 0.06, 0.04)).set_name("arm")
    top, turned = sapien.Pose((0.0, 0.0, 0.7), UPRIGHT), sapien.Pose(q=UPRIGHT)
    arm.set_joint_properties("continuous", [(-9.0, 9.0)], top, turned)
    builder.set_initial_pose(sapien.Pose((0.0, 0.0, 0.6)))
    joint = builder.build(fix_root_link=True).active_joints[0]
    joint.set_drive_properties(0.0, 100.0)
    joint.set_drive_velocity_target(0.8)
    for number in range(5):
        box = scene.create_actor_builder().add_box_collision(half_size=(0.14, 0.14, 0.14))
        box.set_initial_pose(sapien.Pose((0.6, 0.6, 0.14 + 0.28 * number)))
        box.build(f"box{number}")
    lens = EquidistantCamera(240, 240, 70.0, (119.5, 119.5), 1.66)
    with SapienStage(scene) as stage:
        camera = stage.open(lens, omnisim.pose((0.0, 0.0, 0.3), pitch_deg=40.0), vehicle="arm")
        for number in range(4):
            for _ in range(100):
                scene.step()
            frame = camera.render(stage.now(), also=("range", "instance"))
            frame.save(folder / f"{number}.png")
            seen = {stage.names[index] for index in stage.body_ids(frame).flat if index >= 0}
            print(f"{number + 1} s:", *sorted(seen))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
