"""Images of turned squares by a simulated camera, to try `omnisim measure sharpness` with.

python examples/sharpness_edges.py FOLDER

FOLDER/images has linear images of 16 bits, FOLDER/lens.toml the camera without its blur.
"""

import math
import sys
from pathlib import Path

import numpy as np

from omnisim.cameras import PerspectiveCamera
from omnisim.core.files.image_files import write_numbers
from omnisim.rendering.camera.degradations import (
    ChromaticAberration,
    Degradation,
    Noise,
    PointSpread,
)
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.validation.plain_scenes import plain_scene, quads

LENS = PerspectiveCamera.with_field_of_view(640, 480, math.radians(80.0))
RADII_PX = np.linspace(0.0, 400.0, 17)
TWIN = Degradation(
    point_spread=PointSpread(
        tuple((r, 0.5 + 0.5 * (r / 240.0) ** 2, 0.5 + 0.2 * (r / 240.0) ** 2) for r in RADII_PX)
    ),
    chromatic_aberration=ChromaticAberration(
        red_offsets_px=(0.2, 0.5), blue_offsets_px=(-0.1, -0.6)
    ),
    noise=Noise(full_well_e=20_000.0, read_noise_e=5.0, bit_depth=12),
)
GRAY, DARK = (0.7, 0.7, 0.7, 1.0), (0.06, 0.06, 0.06, 1.0)
PITCH_M, HALF_M = 0.22, 0.07


def squares() -> np.ndarray:
    """Corners (n, 4, 3) of squares on a wall 1 m ahead, each turned by 5 to 40° to either side."""
    random = np.random.default_rng(4)
    corners = HALF_M * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    result = []
    for column in range(-5, 6):
        for row in range(-4, 5):
            angle = math.radians(random.uniform(5.0, 40.0)) * random.choice((-1, 1))
            turn = np.array(
                ((math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle)))
            )
            flat = corners @ turn.T + PITCH_M * np.array((column, row))
            result.append(np.column_stack((np.ones(4), flat)))
    return np.stack(result)


def main(folder: Path) -> None:
    """Write three images of the wall, the camera a little to the side each time."""
    wall = [[1.01, -5.0, -5.0], [1.01, 5.0, -5.0], [1.01, 5.0, 5.0], [1.01, -5.0, 5.0]]
    scene = plain_scene("edges", (quads("wall", [wall]), GRAY), (quads("dark", squares(), 1), DARK))
    (folder / "images").mkdir(parents=True, exist_ok=True)
    camera = OmniCamera(LENS)
    (folder / "lens.toml").write_text(camera.to_toml())
    with Stage(scene) as stage, stage.open(camera.with_degradation(TWIN)) as renderer:
        for number in range(3):
            pose = camera.base_pose((0.0, 0.07 * number, 0.03 * number), yaw_deg=2.0 * number)
            linear = renderer.render(pose, linear=True, frame_number=number).linear[..., :3]
            values = np.rint(65535.0 * np.clip(linear, 0.0, 1.0)).astype(np.uint16)
            write_numbers(folder / "images" / f"{number}.png", values)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
