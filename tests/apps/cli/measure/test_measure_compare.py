"""`omnisim measure compare --scene`: images of a scene beside those of the twin."""

import json

import numpy as np
import pytest

from omnisim.core.poses import quaternion_from_rotation
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor

SENSOR = """
[lens]
model = "equidistant"
width_px = 240
height_px = 180
focal_length_px = 90.0
principal_point_px = [119.5, 89.5]
theta_max_deg = 80.0
[degradation.noise]
"""
FRAMED = ("--scene", "courtyard", "--trajectory-frame", "camera")


@pytest.fixture
def scene_images(tmp_path):
    """Folder `photos` of two images, with their poses by name, in another order."""
    pytest.importorskip("cv2")
    pytest.importorskip("matplotlib")
    (tmp_path / "camera.toml").write_text(SENSOR)
    (tmp_path / "photos").mkdir()
    sensor, lines = OmniCamera.from_file(tmp_path / "camera.toml"), []
    with open_sensor("courtyard", sensor, seed=5) as renderer:
        for number in range(2):
            base = sensor.base_pose(
                (0.1 * number, 0.2, 0.9), yaw_deg=100.0 * number, pitch_deg=5.0, roll_deg=3.0
            )
            renderer.render(base, frame_number=number).save(tmp_path / f"photos/{number}.png")
            optical = base @ sensor.base_from_optical
            quaternion = quaternion_from_rotation(optical[None, :3, :3])[0]
            numbers = " ".join(f"{value:.9f}" for value in (*optical[:3, 3], *quaternion))
            lines.insert(0, f"{number}.jpg {numbers}\n")
    (tmp_path / "poses.tum").write_text("".join(lines))
    return tmp_path


@pytest.mark.slow
def test_scene(ran, scene_images):
    options = ("--sensor", "camera.toml", *FRAMED, "--trajectory", "poses.tum", "-o", "report")
    out, _ = ran("measure", "compare", "photos", *options)
    assert "report: written" in out
    assert "2 images: corners of the twin with a bias of at most 0.0" in out
    assert "images brighter than the twin's by" in out
    report = json.loads((scene_images / "report" / "report.json").read_text())
    (measures, *_) = (section["measures"] for section in report["sections"])
    measures = {measure["name"]: measure["value"] for measure in measures}
    assert measures["largest bias of corners, by ring"] < 0.03
    assert measures["gray levels of 90 % of the even blocks"] < 1.5
    assert np.isfinite(measures["exposure of the images relative to the twin's, median"])
