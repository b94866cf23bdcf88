"""Reference implementation of EMVA 1288: its simulated cameras."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from omnisim.measurement.noise import FrameStatistics, frame_statistics

BIT_DEPTHS = (8, 10, 12, 14)
LEVELS, STACK = 16, 7  # exposures, and the number of the one with many frames
STACK_FRAMES = 50
_OFFSETS_PER_SIGMA = 6.0  # of its dark signal above 0, at which it clips
# Bounds of the measurement, as shares of the true value.
BOUNDS = {
    "gain_e_per_dn": 0.01,
    "read_noise_e": 0.03,
    "full_well_e": 0.03,
    "dsnu_e": 0.05,
    "prnu": 0.05,
    "dark_current_e_per_s": 0.05,
}


@dataclass(frozen=True, eq=False)
class ReferenceCamera:
    """Camera of the reference implementation's simulator, with known noise."""

    camera: Any  # `Camera` of the reference implementation
    bit_depth: int  # bits of the converter
    exposure_s: float  # exposure time at which `radiance` saturates the camera
    radiance: Any  # light of the flat fields, in the simulator's units
    true: dict[str, float]  # true values by key of the sensor file

    @classmethod
    def drawn(cls, seed: int, size: tuple[int, int] = (640, 480)) -> ReferenceCamera:
        """Camera with random parameters in the range of real cameras."""
        from emva1288.camera.camera import Camera

        rng = np.random.default_rng(seed)
        width, height = size
        bits = int(rng.choice(BIT_DEPTHS))
        well_e = float(rng.uniform(5e3, 4e4))
        gain = (2**bits - 1) * float(rng.uniform(0.7, 1.3)) / well_e  # DN per electron
        read_e = max(float(rng.uniform(3.0, 20.0)), 0.8 / gain)  # above quantization
        prnu, dsnu_e = float(rng.uniform(0.004, 0.02)), float(rng.uniform(0.7, 8.0))
        current_e_per_s = float(rng.uniform(30.0, 3000.0))
        offset_e = 10.0 + _OFFSETS_PER_SIGMA * (read_e + dsnu_e)
        exposure_s = float(rng.choice((0.02, 0.05)))
        camera = Camera(
            bit_depth=bits, width=width, height=height, seed=seed,
            K=gain, K_min=gain, K_max=gain, K_steps=1, blackoffset=0, u_esat=well_e,
            dark_signal_0=offset_e, sigma2_dark_0=read_e**2, dark_current_ref=current_e_per_s,
            temperature=30.0, temperature_ref=30.0, exposure=1e9 * exposure_s,
            dsnu=rng.normal(0.0, dsnu_e, (height, width)),
            prnu=1.0 + rng.normal(0.0, prnu, (height, width)),
        )  # fmt: skip
        full_e = min(well_e, (2**bits - 1) / gain)
        true = {
            "gain_e_per_dn": 1.0 / gain,
            # it quantizes twice, once by a uniform random number
            "read_noise_e": float(np.sqrt(read_e**2 + 1.0 / 12.0 / gain**2)),
            "full_well_e": full_e - offset_e,
            "dsnu_e": dsnu_e,
            "prnu": prnu,
            "dark_current_e_per_s": current_e_per_s,
        }
        radiance = camera.get_radiance_for(mean=full_e * gain)
        return cls(camera, bits, exposure_s, radiance, true)

    def dark_and_flat(self) -> tuple[list[FrameStatistics], list[FrameStatistics]]:
        """Statistics of dark frames and flat fields: two per exposure, 50 at one exposure."""
        darks: list[FrameStatistics] = []
        flats: list[FrameStatistics] = []
        for number, share in enumerate(np.linspace(0.03, 1.15, LEVELS)):
            time_s = float(share * self.exposure_s)
            self.camera.exposure = 1e9 * time_s
            count = STACK_FRAMES if number == STACK else 2
            for group, light in ((darks, 0), (flats, self.radiance)):
                frames = (self.camera.grab(light) for _ in range(count))
                group.append(frame_statistics(frames, time_s, f"{1e3 * time_s:.3g}ms"))
        return darks, flats

    def truth(self) -> dict[str, tuple[float, float]]:
        """True values with the relative bounds of their measurement."""
        return {name: (value, BOUNDS[name]) for name, value in self.true.items()}
