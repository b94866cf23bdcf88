"""Fisheye above the ant of Gymnasium: python gymnasium_camera.py [FOLDER].

It needs `pip install 'omnisim-camera[gymnasium,mujoco]' 'gymnasium[mujoco]'`. The images that an
agent would get go into the folder.
"""

import sys
from pathlib import Path

import gymnasium

import omnisim
from omnisim.cameras import EquidistantCamera
from omnisim.core.files.image_files import write_image
from omnisim.follow import CameraWrapper


def main(folder: Path) -> None:
    lens = EquidistantCamera(240, 240, 70.0, (119.5, 119.5), 1.66)
    mount = omnisim.pose((0.0, 0.0, 0.6), pitch_deg=60.0)
    env = CameraWrapper(
        gymnasium.make("Ant-v5"), lens, vehicle="torso", base_from_sensor=mount,
        channels=("rgb", "range"),
    )  # fmt: skip
    env.action_space.seed(1)
    observation, _ = env.reset(seed=1)
    for number in range(3):
        write_image(folder / f"{number}.png", observation["omni"])
        print({key: value.shape for key, value in observation.items()})
        for _ in range(10):
            observation, _, is_over, _, _ = env.step(env.action_space.sample())
            if is_over:
                observation, _ = env.reset()
    env.close()


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
