"""Sheet of all degradations and presets.

`python .ci/make_degradation_sheet.py FILE` draws it.

The first rows show each degradation alone, stronger than in most cameras, as a whole image or as a
part of a finer image, magnified four times. In all these images the camera turns left at 120°/s,
which only shutters show. The last images are those of the presets on a robot that drives and turns.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.plots.contact_sheet import magnified, save_contact_sheet
from omnisim.rendering.camera.degradations import (
    Bayer,
    ChromaticAberration,
    Defocus,
    Degradation,
    Dirt,
    Encoding,
    Exposure,
    Jpeg,
    Noise,
    PointSpread,
    Reflectance,
    Shutter,
    Vignetting,
    WhiteBalance,
    preset,
)
from omnisim.rendering.camera.degradations.degradation_file import EFFECTS
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.rendering.twist import Twist
from omnisim.scene import load_scene

SIDE_PX, FINE_PX, TIMES, COLUMNS = 240, 360, 4, 4
PART = np.s_[22:82, 178:238]  # of the fine image: a poster, desks, the blue goal, a line
TURNING_LEFT = Twist(angular_radps=(0.0, 0.0, math.radians(120.0)))
DRIVING = Twist((0.6, 0.0, 0.0), (0.0, 0.0, math.radians(40.0)))

WHOLE = {
    "ideal": Degradation(),
    "reflectance 0.7, warm tint": Degradation(reflectance=Reflectance(0.7, (1.0, 0.93, 0.8))),
    "dust and scratches": Degradation(
        dirt=Dirt(
            dust_count=140,
            dust_radius_px=1.7,
            dust_opacity=0.7,
            scratch_count=18,
            scratch_width_px=0.5,
            scratch_length_px=80.0,
            scratch_opacity=0.5,
            dust_glow=0.05,
            scratch_glow=0.8,
        )
    ),
    "vignetting, cos⁴ to 30°": Degradation(vignetting=Vignetting.cos4(math.tan(math.pi / 6.0))),
    "exposure +1.5 EV": Degradation(exposure=Exposure(ev=1.5)),
    "auto-exposure, target 0.06": Degradation(exposure=Exposure(auto=True, target=0.06)),
    "white balance of lamplight": Degradation(
        white_balance=WhiteBalance((1.0, 0.8, 0.5), (1.0, 1.0, 1.0))
    ),
    "gamma 1": Degradation(encoding=Encoding(1.0)),
    "gamma 2.2, 3 bits": Degradation(encoding=Encoding(2.2, 3)),
    "film's curve": Degradation(
        encoding=Encoding(curve=((0.0, 0.0), (0.05, 0.12), (0.2, 0.6), (0.6, 0.9), (2.0, 1.0)))
    ),
    "exposure 50 ms, turning left": Degradation(shutter=Shutter(exposure_s=0.05)),
}
PARTS = {
    "ideal": Degradation(),
    "defocus 1 to 3 px": Degradation(defocus=Defocus(1.0, 3.0)),
    "spread 3 × 0.5 px at the rim": Degradation(
        point_spread=PointSpread(((0.0, 0.5, 0.5), (FINE_PX / 2.0, 3.0, 0.5)))
    ),
    "red +1 %, blue −1 %": Degradation(chromatic_aberration=ChromaticAberration(1.01, 0.99)),
    "red +3, blue −3 px at the rim": Degradation(
        chromatic_aberration=ChromaticAberration(
            red_offsets_px=(0.0, 0.0, 3.0), blue_offsets_px=(0.0, 0.0, -3.0)
        )
    ),
    "noise: full well of 500 e⁻": Degradation(
        noise=Noise(full_well_e=500.0, read_noise_e=3.0, bit_depth=10)
    ),
    "read noise 60 of 3000 e⁻": Degradation(
        noise=Noise(
            full_well_e=3000.0,
            read_noise_e=60.0,
            dark_current_e_per_s=0.0,
            black_level_dn=60.0,
            bit_depth=10,
        )
    ),
    "Bayer mosaic RGGB": Degradation(bayer=Bayer(demosaic="none")),
    "demosaicked bilinearly": Degradation(bayer=Bayer(demosaic="bilinear")),
    "demosaicked by Malvar": Degradation(bayer=Bayer()),
    "noise, then Malvar": Degradation(
        noise=Noise(full_well_e=500.0, read_noise_e=3.0), bayer=Bayer()
    ),
    "JPEG, quality 50": Degradation(jpeg=Jpeg(50)),
    "JPEG, quality 10": Degradation(jpeg=Jpeg(10)),
    "exposure 50 ms, turning": Degradation(shutter=Shutter(exposure_s=0.05)),
}
AHEAD = {
    "perspective lens": Degradation(),
    "rolling shutter, turning left": Degradation(shutter=Shutter(readout_s=0.06)),
}
PRESETS = ("ideal", "dragonfly2", "webcam", "bad-day")
_SHOWN = {name for one in (*WHOLE.values(), *PARTS.values()) for name in one.parts}


def _with_defaults(name: str) -> Degradation:
    effect: dict[str, Any] = {name: EFFECTS[name]()}
    return Degradation(**effect)


OTHERS = {name: _with_defaults(name) for name in EFFECTS if name not in _SHOWN}


def degradation_tiles(scene_name: str = "soccer") -> list[tuple[str, NDArray[np.uint8]]]:
    """Titles and images of every degradation and preset.

    Raises:
        OmnisimError: an unknown scene, or no OpenGL.
    """
    scene = load_scene(scene_name)
    mirror, fine = OmniCamera().resized(SIDE_PX), OmniCamera().resized(FINE_PX)
    lens = OmniCamera(PerspectiveCamera.with_field_of_view(SIDE_PX, SIDE_PX, math.radians(80.0)))
    start, yaw_deg = scene.start.position_m, scene.start.yaw_deg
    tiles = []
    with Stage(scene) as stage:

        def render(camera: OmniCamera, degradation: Degradation, twist: Twist) -> NDArray[np.uint8]:
            pose = camera.base_pose(start, yaw_deg=yaw_deg)
            with stage.open(camera.with_degradation(degradation)) as renderer:
                return renderer.render(pose, motion=twist.through(pose)).rgb

        for title, degradation in (WHOLE | OTHERS).items():
            tiles.append((title, render(mirror, degradation, TURNING_LEFT)))
        for title, degradation in AHEAD.items():
            tiles.append((title, render(lens, degradation, TURNING_LEFT)))
        for title, degradation in PARTS.items():
            part = render(fine, degradation, TURNING_LEFT)[PART]
            tiles.append((f"{title}, ×{TIMES}", magnified(part, TIMES)))
        for name in PRESETS:
            tiles.append((f"preset {name}, driving", render(mirror, preset(name), DRIVING)))
    return tiles


if __name__ == "__main__":
    save_contact_sheet(Path(sys.argv[1]), degradation_tiles(), COLUMNS)
