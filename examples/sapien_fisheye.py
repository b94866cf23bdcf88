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
SIZES = (("mast", (0.1, 0.1, 0.6)), ("arm", (0.5, 0.06, 0.04)))


def main(folder: Path) -> None:
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    scene.add_ground(0.0, render=False)
    builder, links = scene.create_articulation_builder(), []
    for name, half_size in SIZES:
        link = builder.create_link_builder(links[-1] if links else None)
        link.add_box_collision(sapien.Pose((half_size[0] - 0.1, 0.0, 0.0)), half_size)
        link.set_name(name)
        links.append(link)
    top, turned = sapien.Pose((0.0, 0.0, 0.7), UPRIGHT), sapien.Pose(q=UPRIGHT)
    links[1].set_joint_properties("continuous", [(-9.0, 9.0)], top, turned)
    builder.set_initial_pose(sapien.Pose((0.0, 0.0, 0.6)))
    robot = builder.build(fix_root_link=True)
    robot.active_joints[0].set_drive_properties(0.0, 100.0)
    robot.active_joints[0].set_drive_velocity_target(0.8)
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
