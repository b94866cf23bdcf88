"""Metal and gloss of both back ends against Mitsuba's principled BSDF."""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="Mitsuba is an optional oracle")
from omnisim.validation.checks import materials
from omnisim.validation.checks.materials import ciede2000, lab_from_linear

pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.mark.parametrize(
    ("name", "samples"),
    [
        ("a lamp", 16),
        pytest.param("even light", 64, marks=pytest.mark.slow),
        pytest.param("an environment map", 144, marks=[pytest.mark.slow, pytest.mark.long]),
    ],
)
def test_the_chart_looks_as_traced(name, samples):
    ours, traced, spheres = materials.charts(materials.lightings()[name], samples, None)
    difference = ciede2000(lab_from_linear(ours), lab_from_linear(traced))
    assert difference[spheres >= 0].mean() < materials.BOUND
    # metals differ by the shadowing of facets alone, which is seen where they are rough
    is_smooth_metal = np.isin(spheres, [2, 5, 8])
    assert difference[is_smooth_metal].mean() < (1.5 if name == "an environment map" else 0.3)
