"""Quality of the image in other scenes than that of the validation."""

import pytest

from omnisim.scene import load_scene
from omnisim.validation.checks.other_renderers import measure_quality
from omnisim.validation.fixture import Fixture
from tests.scenes import with_warehouse


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.slow
@with_warehouse("soccer", long=True)
def test_default_quality(source):
    # measured: 40.6 dB and 0.325 in soccer, 41.0 dB and 0.301 in the warehouse
    section = measure_quality(Fixture(is_quick=True), load_scene(source), (1.0, -2.0, 1.2), "")
    assert section.missed == []
