"""Poses of COLMAP's models as trajectories: those of the exported, true model are the truth."""

import subprocess
import sys

import numpy as np
import pytest

from omnisim.core.poses import inverse
from omnisim.datasets.export.export import for_format
from omnisim.datasets.export.export_format import ExportSettings
from omnisim.datasets.export.export_formats import format_named
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimators.colmap_mapping import ColmapMapping, _trajectory
from tests.evaluation.test_estimators import ROBOT

MIRROR = """
[[sensors]]
name = "ring"
type = "omnicamera"
position_m = [0.1, 0.05, 1.0]
roll_deg = 5.0
yaw_deg = 20.0
"""
STEPS = ("--step", "1", "--turn-step", "60", "--size", "32", "--quality", "fast")


def _ignore(note):
    pass


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_the_true_model_of_a_mirror_is_the_true_way(tmp_path):
    """Its lens is exported upright, which the mirror's own optical frame is not."""
    pycolmap = pytest.importorskip("pycolmap")
    (tmp_path / "robot.toml").write_text(ROBOT + MIRROR)
    words = ["drive", "rings", "--robot", "robot.toml", "--path", "way.csv", "-o", "run", *STEPS]
    (tmp_path / "way.csv").write_text("x_m,y_m\n-1,0\n0,0.5\n1,0\n")
    subprocess.run([sys.executable, "-m", "omnisim", *words], cwd=tmp_path, check=True)
    form = format_named("colmap")
    run = for_format(Recording.read(tmp_path / "run", "ring"), form, _ignore)
    for _ in form.write(run, tmp_path, ExportSettings(), _ignore):
        pass
    models = {0: pycolmap.Reconstruction(tmp_path / "sparse" / "0")}
    tracked_from_base = ColmapMapping().tracked_from_base(run)
    estimate = _trajectory(models, run, tracked_from_base)
    truth = run.truth.world_from_base @ inverse(tracked_from_base)
    np.testing.assert_allclose(estimate.times_s, run.truth.times_s)
    np.testing.assert_allclose(estimate.world_from_base, truth, atol=1e-6)
