"""The example of a camera beside Newton's quadruped runs, and sees it fall on its feet."""

import re
import runpy
from pathlib import Path

import pytest

from omnisim.core.files.image_files import read_image

pytest.importorskip("newton", reason="Newton is not installed")
PATH = Path(__file__).resolve().parents[2] / "examples" / "newton_quadruped.py"


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.usefixtures("needs_opengl")
def test_the_robot_falls_on_its_feet(tmp_path, capsys):
    runpy.run_path(str(PATH))["main"](tmp_path)
    printed = re.findall(r"is ([\d.]+) m above", capsys.readouterr().out)
    heights_m = [float(height) for height in printed]
    assert heights_m[0] > heights_m[1] > heights_m[2] > heights_m[3] - 0.02 > 0.3
    rows = []
    for number in range(4):
        red, _, blue = read_image(tmp_path / f"{number}.png")[0][..., :3].astype(int).T
        is_base = (blue > red + 60) & (blue < 190)  # darker than the sky
        rows.append(is_base.T.nonzero()[0].mean())
    assert rows[0] < rows[1] < rows[2]
