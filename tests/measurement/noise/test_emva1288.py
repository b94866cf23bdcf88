"""Our measurement and our noise against the reference implementation of EMVA 1288."""

import numpy as np
import pytest

from omnisim.measurement.noise import measure_noise
from omnisim.validation.oracles.emva import ReferenceCamera
from tests.measurement.noise.frames import NOISE, TIMES_S, Camera
from tests.measurement.noise.reference import reference_results

pytest.importorskip("emva1288")
pytestmark = pytest.mark.slow


def test_its_camera_is_measured():
    """One with a quarter of the pixels; `omnisim validate --only noise` measures more."""
    camera = ReferenceCamera.drawn(0, (320, 240))
    measured = measure_noise(*camera.dark_and_flat(), bit_depth=camera.bit_depth)
    values = {one.name: one.value for one in measured.quantities}
    for name, (true, bound) in camera.truth().items():
        assert values[name] == pytest.approx(true, rel=bound), name


@pytest.mark.long
def test_it_measures_our_noise():
    """Gain 2 %, dark noise 3 %, full well 3 %, largest SNR 0.2 dB, by its own evaluation."""
    camera = Camera(size=(320, 240))
    exposures = {}
    for number, time_s in enumerate(TIMES_S):
        count = 50 if number == 4 else 2
        light = time_s / (0.85 * TIMES_S[-1])
        exposures[float(time_s)] = (
            camera.frames(0.0, time_s, count),
            camera.frames(light, time_s, count),
        )
    results = reference_results(exposures)
    assert results.gain_e_per_dn == pytest.approx(NOISE.gain_e_per_dn, rel=0.02)
    # by its line through the variances of all exposures, at none
    assert results.dark_noise_e == pytest.approx(NOISE.read_noise_e, rel=0.03)
    assert results.dsnu_e == pytest.approx(NOISE.dsnu_e, rel=0.05)
    assert results.prnu == pytest.approx(NOISE.prnu, rel=0.05)
    shares = TIMES_S / (0.85 * TIMES_S[-1])
    brightest = shares[shares < 1.0].max()  # it takes the flat with the largest variance
    saturation_db = 10.0 * np.log10(brightest * NOISE.white_e)
    assert results.max_snr_db == pytest.approx(saturation_db, abs=0.2)
