"""Quality of the picture in a scene that nobody made for omnisim."""

import pytest

from omnisim.scene import load_scene
from omnisim.validation.checks.picture_quality import measure_quality
from omnisim.validation.fixture import Fixture


@pytest.mark.usefixtures("needs_opengl")
def test_default_quality_in_a_real_warehouse(warehouse):
    scene = load_scene(str(warehouse))
    section = measure_quality(Fixture(is_quick=True), scene, (1.0, -2.0, 1.2), "")
    assert section.missed == []
