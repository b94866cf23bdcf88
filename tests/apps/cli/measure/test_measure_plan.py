"""`omnisim measure plan`: parts in order, the report, and work that is not done twice."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import omnisim as package
from omnisim.rendering.camera.omnicamera import OmniCamera

EXAMPLE = Path(package.__file__).parents[1] / "examples" / "board_images.py"
MEASURE = ("measure", "plan", "plan.toml", "-o", "camera.toml")
PLAN = """
[compare]

[response]
images = "series"

[geometry]
images = "photos"
board = "8x6:80mm"
model = ["kannala_brandt"]
"""


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    pytest.importorskip("cv2")
    folder = tmp_path_factory.mktemp("photos")
    subprocess.run([sys.executable, EXAMPLE, folder], check=True)
    return folder


@pytest.mark.slow
@pytest.mark.long
def test_parts_are_measured_once(ran, photos, response_series, tmp_path):
    (tmp_path / "photos").symlink_to(photos)
    (tmp_path / "plan.toml").write_text(PLAN)
    out, _ = ran(*MEASURE)
    assert out.index("geometry") < out.index("response") < out.index("compare")
    camera = OmniCamera.from_file(tmp_path / "camera.toml")
    assert camera.degradation.encoding.gamma == pytest.approx(2.0, rel=0.01)
    sections = json.loads((tmp_path / "camera-report" / "report.json").read_text())["sections"]
    titles = [section["title"] for section in sections]
    assert titles == ["The camera and its twin", "Geometry", "Response"]
    before = [(tmp_path / f"camera.{suffix}").read_bytes() for suffix in ("toml", "json")]
    out, _ = ran(*MEASURE)
    assert "geometry: already measured" in out
    assert "response: already measured" in out
    assert before == [(tmp_path / f"camera.{suffix}").read_bytes() for suffix in ("toml", "json")]


def test_a_changed_file_is_measured_again(ran, response_series, tmp_path):
    (tmp_path / "plan.toml").write_text('[response]\nimages = "series"\n')
    ran(*MEASURE)
    first = sorted(response_series.rglob("*.png"))[0]
    first.write_bytes(first.read_bytes() + b" ")  # after the image's end
    assert "already measured" not in ran(*MEASURE)[0]
    assert (tmp_path / "camera-report" / "report.html").exists()


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        ("", "plan.toml: expected a table of geometry, response, timing, sharpness, noise"),
        ("[geometry]\nboard = '8x6:80mm'\n", "plan.toml: geometry.images: missing"),
        ("[geometry]\nimages = 3\n", "plan.toml: geometry.images: expected a path, as text, got 3"),
        ("[shape]\n", "plan.toml: shape: unknown key"),
        ("[compare]\n[response]\nimages = 's'\n", "plan.toml: compare.images: missing"),
        ("[response]\nimages = 's'\nblack = -1\n", "plan.toml: response.black: expected a number"),
        ("[response]\nimages = 's'\noutput = 'a'\n", "plan.toml: response.output: unknown key"),
        ("[geometry]\nimages = '.'\noptics = 'a'\n", "plan.toml: geometry: --optics: requires"),
        ("[response]\nimages = 'none'\n", "none: expected a folder"),
    ],
)
def test_faults_are_named(omnisim, tmp_path, plan, message):
    (tmp_path / "plan.toml").write_text(plan)
    status, _, error = omnisim(*MEASURE)
    assert (status, message in error) == (1, True)
    assert [path.name for path in tmp_path.iterdir()] == ["plan.toml"]
