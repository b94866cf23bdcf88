"""Quality of the picture in a scene that nobody made for omnisim."""

import pytest

from omnisim.scene import load_scene
from omnisim.validation.check import Bench
from omnisim.validation.checks.picture_quality import measure_quality


@pytest.mark.usefixtures("needs_opengl")
def test_default_quality_in_a_real_warehouse(warehouse):
    scene = load_scene(str(warehouse))
    findings = measure_quality(Bench(is_quick=True), scene, (1.0, -2.0, 1.2))
    assert [measure for measure in findings.measures if not measure.passed] == []
