"""Frames of a simulated camera with known noise."""

import numpy as np

from omnisim.measurement.noise import frame_statistics
from omnisim.rendering.camera.degradations import Noise
from omnisim.rendering.camera.degradations.effect import Shot
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry

NOISE = Noise(
    full_well_e=12_000.0, gain_e_per_dn=3.1, read_noise_e=6.5, dark_current_e_per_s=900.0,
    black_level_dn=40.0, bit_depth=12, prnu=0.011, dsnu_e=4.0,
)  # fmt: skip
TIMES_S = np.linspace(2e-3, 40e-3, 10)


class Camera:
    """Camera that counts its frames, of a width and height in pixels."""

    def __init__(self, noise=NOISE, size=(160, 120)):
        self._noise, self._frames = noise, 0
        self._geometry = ImageGeometry(*size, (0.5 * size[0], 0.5 * size[1]))

    def frame(self, light, exposure_s):
        """Raw frame (height, width) uint16 of linear light, a number or (height, width)."""
        shape = self._geometry.height_px, self._geometry.width_px
        image = np.ones((*shape, 4), dtype=np.float32)
        image[..., :3] = np.broadcast_to(light, shape)[..., None]
        self._frames += 1
        noise = self._noise
        shot = Shot(exposure_s=exposure_s, noise_key=5, frame_number=self._frames)
        linear = noise.apply(image, self._geometry, shot)[..., 1].astype(np.float64)
        electrons = linear * noise.white_e + noise.dark_current_e_per_s * exposure_s
        return np.rint(electrons / noise.gain + noise.black_level_dn).astype(np.uint16)

    def frames(self, light, exposure_s, count=2):
        """Raw frames, one after the other."""
        return [self.frame(light, exposure_s) for _ in range(count)]

    def statistics(self, light, exposure_s, count=2, name="frames"):
        """Statistics of raw frames."""
        return frame_statistics(self.frames(light, exposure_s, count), exposure_s, name)


def dark_and_flat(camera, times_s=TIMES_S, stack=4, stack_count=16, flat_light=1.0):
    """Statistics of dark frames and flat fields; the brightest flats saturate.

    Exposure `stack` has `stack_count` frames, others have 2; `flat_light` (height, width) is a
    factor of the light.
    """
    darks, flats = [], []
    for number, time_s in enumerate(times_s):
        count = stack_count if number == stack else 2
        darks.append(camera.statistics(0.0, time_s, count, f"dark/{number}"))
        light = flat_light * time_s / (0.85 * times_s[-1])
        flats.append(camera.statistics(light, time_s, count, f"flat/{number}"))
    return darks, flats
