"""Fisheye on a robot's head in a simulation of MuJoCo: python mujoco_fisheye.py [FOLDER].

It needs `pip install 'omnisim-camera[mujoco]'`. Images and range maps go into the folder.
"""

import sys
from pathlib import Path

import mujoco

from omnisim.cameras import EquidistantCamera
from omnisim.follow import MujocoStage

MODEL = Path(__file__).with_name("mujoco_room.xml")


def main(folder: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lens = EquidistantCamera(240, 240, 70.0, (119.5, 119.5), 1.66)
    with MujocoStage(model, data) as stage:
        camera = stage.open(lens, vehicle="site/head")
        for number in range(4):
            data.ctrl[0] = 0.5
            mujoco.mj_step(model, data, 100)
            frame = camera.render(stage.now(), also=("range", "instance"))
            frame.save(folder / f"{number}.png")
            pixels = int((stage.geom_ids(frame) == stage.geoms["ball/sphere"]).sum())
            print(f"{data.time:.1f} s: the ball has {pixels} pixels")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
