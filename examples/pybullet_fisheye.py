"""Fisheye on PyBullet's Husky, which drives into a ball: python pybullet_fisheye.py [FOLDER].

It needs `pip install 'omnisim-camera[pybullet]'`. Images and range maps go into the folder.
"""

import sys
from pathlib import Path

import pybullet
import pybullet_data

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.follow import PyBulletStage

WHEELS = (2, 3, 4, 5)


def main(folder: Path) -> None:
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setAdditionalSearchPath(pybullet_data.getDataPath())
    pybullet.setGravity(0.0, 0.0, -9.81)
    pybullet.loadURDF("plane.urdf")
    husky = pybullet.loadURDF("husky/husky.urdf", (0.0, 0.0, 0.1))
    ball = pybullet.loadURDF("soccerball.urdf", (2.0, 0.2, 0.5))
    pybullet.loadURDF("table/table.urdf", (2.5, -2.0, 0.0))
    lens = EquidistantCamera(240, 240, 70.0, (119.5, 119.5), 1.66)
    with PyBulletStage(client) as stage:
        camera = stage.open(
            lens, omnisim.pose((0.3, 0.0, 0.8), pitch_deg=30.0), vehicle="base_link"
        )
        mode, speeds = pybullet.VELOCITY_CONTROL, [8.0] * len(WHEELS)
        pybullet.setJointMotorControlArray(husky, WHEELS, mode, targetVelocities=speeds)
        for number in range(4):
            for _ in range(120):
                pybullet.stepSimulation()
            frame = camera.render(stage.now(), also=("range", "instance"))
            frame.save(folder / f"{number}.png")
            pixels = stage.body_ids(frame) == stage.names.index(stage.name_of(ball))
            print(f"{0.5 * (number + 1)} s: the ball has {pixels.sum()} pixels")
    pybullet.disconnect(client)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
