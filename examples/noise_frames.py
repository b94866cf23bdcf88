"""Dark frames and flat fields of a simulated camera, to try `omnisim measure noise` with.

python examples/noise_frames.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np

from omnisim.core.files.image_files import write_numbers
from omnisim.rendering.camera.degradations import Noise
from omnisim.rendering.camera.degradations.effect import Shot
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry

NOISE = Noise(
    full_well_e=12_000.0,
    gain_e_per_dn=3.1,
    read_noise_e=6.5,
    dark_current_e_per_s=900.0,
    black_level_dn=40.0,
    bit_depth=12,
    prnu=0.011,
    dsnu_e=4.0,
)
GEOMETRY = ImageGeometry(320, 240, (159.5, 119.5))
SATURATED_MS = 34.0  # exposure that fills the wells


def raw_frame(light: float, exposure_s: float, number: int) -> np.ndarray:
    """Values (height, width) of the converter, for even linear light."""
    image = np.ones((GEOMETRY.height_px, GEOMETRY.width_px, 4), dtype=np.float32)
    image[..., :3] = light
    linear = NOISE.apply(image, GEOMETRY, Shot(exposure_s=exposure_s, frame_number=number))
    electrons = linear[..., 0] * NOISE.white_e + NOISE.dark_current_e_per_s * exposure_s
    return np.rint(electrons / NOISE.gain + NOISE.black_level_dn).astype(np.uint16)


def main(folder: Path) -> None:
    """Write two frames per exposure, and 20 at one exposure for the fixed pattern."""
    number = 0
    for index, exposure_ms in enumerate(np.linspace(2.0, 40.0, 12)):
        for kind, light in (("dark", 0.0), ("flat", exposure_ms / SATURATED_MS)):
            frames = folder / kind / f"{exposure_ms:.2f}ms"
            frames.mkdir(parents=True, exist_ok=True)
            for _ in range(20 if index == 5 else 2):
                number += 1
                values = raw_frame(light, 1e-3 * exposure_ms, number)
                write_numbers(frames / f"{number:03}.png", values)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
