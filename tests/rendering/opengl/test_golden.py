"""Golden images, the last line of proof: only on llvmpipe, the one renderer all can have.

To renew them after a change that is meant to be seen: OMNISIM_RENEW_GOLDEN=1 pytest this file,
and look at every image before it is committed.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image, write_image
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.rendering.stage import open_sensor
from omnisim.scene import load_scene

GOLDEN = Path(__file__).resolve().parents[2] / "golden"
SENSOR = OmniCamera.from_table(
    {"mirror": {"polygons": 1024}, "camera": {"width_px": 180, "height_px": 180}}
)


def _panoramic(theta_max_deg):
    return OmniCamera.from_table(
        {
            "mirror": {"theta_max_deg": theta_max_deg, "polygons": "exact"},
            "camera": {"width_px": 180, "height_px": 180},
        }
    )


CASES = {
    "courtyard-1024": (SENSOR, False, 0.0),
    "courtyard-16": (SENSOR.with_polygons(16), False, 0.0),
    "courtyard-six-faces-unlit": (_panoramic(150.0), True, 40.0),
}


@pytest.mark.parametrize("name", CASES)
def test_image_is_the_golden_one(context, name, tmp_path):
    if "llvmpipe" not in graphics_info(context).renderer:
        pytest.skip("golden images are llvmpipe's")
    sensor, unlit, yaw_deg = CASES[name]
    scene = load_scene("courtyard", sky="none")  # of drawing, in even light
    with open_sensor(scene, sensor, unlit=unlit) as renderer:
        pixels = renderer.render(sensor.base_pose((0.5, -1.0, 0.9), yaw_deg=yaw_deg)).rgb
    path = GOLDEN / f"{name}.png"
    if os.environ.get("OMNISIM_RENEW_GOLDEN"):
        write_image(path, np.ascontiguousarray(pixels))
    golden, _ = read_image(path)
    off = np.abs(pixels.astype(int) - golden)
    # Versions of llvmpipe place a sample or round a color differently: that moves single pixels
    # on edges and no others.
    if off.mean() > 0.25 or (off.max(axis=-1) > 24).mean() > 0.005:
        difference = tmp_path / f"{name}-difference.png"
        write_image(difference, np.clip(8 * off, 0, 255).astype(np.uint8))
        write_image(tmp_path / f"{name}.png", np.ascontiguousarray(pixels))
        pytest.fail(f"mean difference {off.mean():.3f} levels, see {difference}")
