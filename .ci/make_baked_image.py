"""Render the image of baked light beside Mitsuba's: `python .ci/make_baked_image.py FILE`.

Each row is a lit scene of the validation through the paper's mirror or a fisheye: the lamps alone,
with their shadows; in its baked light; and by Mitsuba, with all bounces. Prints how far the latter
two are apart.
"""

import sys
from pathlib import Path

import numpy as np

from omnisim import load_scene, open_sensor
from omnisim.core.srgb import srgb8_from_linear
from omnisim.plots.contact_sheet import save_contact_sheet
from omnisim.validation.checks.lit_scenes import FOLDER, SETTINGS, in_baked_light
from omnisim.validation.fixture import linear_image
from omnisim.validation.image_differences import psnr_db, ssim
from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides
from omnisim.validation.traced_light import views

SIZE_PX = 260
SAMPLES = {"mirror": 225, "fisheye": 9}  # see `traced_light`
ROWS = {"soccer": ("mirror", "fisheye"), "courtyard": ("fisheye",)}


def main(path: str) -> None:
    """Write the image."""
    tiles = []
    for name, cameras in ROWS.items():
        scene = matte_on_both_sides(load_scene(FOLDER / f"{name}.toml"))
        baked = in_baked_light(scene, SETTINGS)
        for view in views(scene, SIZE_PX, cameras):
            tiles += row(name, baked, view)
    save_contact_sheet(Path(path), tiles, columns=3)


def row(name, baked, view):
    """Titles and images (height, width, 3) of one scene through one camera."""
    inside = view.inside
    alone, ours = (rendered(scene, view) for scene in (view.scene, baked))
    traced = view.traced(SAMPLES[view.camera], bounces=True)
    level, likeness = psnr_db(traced, ours, inside), ssim(traced, ours, inside)
    print(
        f"{name}, {view.camera}: {level:.1f} dB, structural similarity {likeness:.3f}", flush=True
    )
    images = {"lamps alone": alone, "baked": ours, "Mitsuba, all light": traced}
    return [
        (title, srgb8_from_linear(np.clip(np.where(inside[..., None], linear, 0.0), 0.0, 1.0)))
        for title, linear in images.items()
    ]


def rendered(scene, view):
    """Linear image (height, width, 3)."""
    with open_sensor(scene, view.sensor) as renderer:
        return linear_image(renderer.render(view.pose, linear=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
