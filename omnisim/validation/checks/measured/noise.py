"""Noise, measured from frames simulated by the reference implementation of EMVA 1288."""

from __future__ import annotations

import numpy as np

from omnisim.measurement.noise import measure_noise
from omnisim.report.report import Measure, ResultTable, Section
from omnisim.validation.fixture import Fixture
from omnisim.validation.oracles.emva import BOUNDS, ReferenceCamera

CAMERAS, QUICK_CAMERAS = 20, 1


def check(fixture: Fixture, title: str) -> Section:
    """Measure the noise of random cameras; compare it with their true parameters."""
    count = QUICK_CAMERAS if fixture.is_quick else CAMERAS
    errors: dict[str, list[float]] = {name: [] for name in BOUNDS}
    rows = []
    for seed in range(count):
        camera = ReferenceCamera.drawn(seed)
        measured = measure_noise(*camera.dark_and_flat(), bit_depth=camera.bit_depth)
        values = {quantity.name: quantity.value for quantity in measured.quantities}
        cells = []
        for name, (true, _) in camera.truth().items():
            errors[name].append(values.get(name, np.inf) / true - 1.0)
            cells.append(f"{true:.4g} ({100.0 * errors[name][-1]:+.2f} %)")
        rows.append((str(camera.bit_depth), *cells))
    caption = "True values, and errors of the measured ones"
    return Section(
        title,
        "Parameters measured by `omnisim measure noise` against the true ones, for "
        f"{count} random cameras of the simulator of EMVA 1288. Each has two dark frames and two "
        "flat fields at each of 16 exposures, and 50 at one of them, with 640 × 480 px.",
        [
            Measure(f"{name}, largest error", 100.0 * float(np.abs(errors[name]).max()), "%",
                    100.0 * bound)
            for name, bound in BOUNDS.items()
        ],
        [ResultTable(caption, ("bits", *BOUNDS), tuple(rows))],
    )  # fmt: skip
