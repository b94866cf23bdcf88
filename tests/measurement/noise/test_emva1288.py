"""Our noise, measured by the reference implementation of EMVA 1288."""

from functools import partial

import numpy as np
import pytest

from tests.measurement.noise.frames import NOISE, TIMES_S, Camera

pytest.importorskip("emva1288")
pytestmark = [pytest.mark.slow, pytest.mark.long]


def _reference_results(exposures):
    """Its evaluation of (dark, flat) raw frames by exposure time in seconds.

    The exposure with the most frames also determines the nonuniformities.
    """
    from emva1288.process.data import Data1288
    from emva1288.process.results import Results1288
    from emva1288.process.routines import get_int_imgs

    temporal = {}
    for number, (time_s, groups) in enumerate(sorted(exposures.items()), start=1):
        parts = [get_int_imgs(list(frames[:2])) for frames in groups]
        sums = [
            {"sum": part["sum"].sum(), "pvar": part["pvar"].sum(), "dmean": part["dmean"]}
            for part in parts
        ]
        # light counts only by its order: photons are unknown, and no result here needs them
        temporal[time_s] = {0.0: sums[0], 1000.0 * number: sums[1]}
    stack_s = max(exposures, key=lambda time_s: len(exposures[time_s][0]))
    dark, flat = (get_int_imgs(list(frames)) for frames in exposures[stack_s])
    height, width = exposures[stack_s][0][0].shape
    spatial = {stack_s: {0.0: dark, 1000.0: flat}}
    data = {"temporal": temporal, "spatial": spatial, "width": width, "height": height}
    return Results1288(Data1288(data).data)


def test_it_measures_our_noise(monkeypatch):
    """Gain 2 %, dark noise 3 %, full well 3 %, largest SNR 0.2 dB, by its own evaluation."""
    # which it calls and NumPy 2 dropped
    monkeypatch.setattr(np, "asfarray", partial(np.asarray, dtype=float), raising=False)
    camera, exposures = Camera(size=(320, 240)), {}
    shares = TIMES_S / (0.85 * TIMES_S[-1])
    for number, (time_s, light) in enumerate(zip(TIMES_S.tolist(), shares, strict=True)):
        count = 50 if number == 4 else 2
        exposures[time_s] = [camera.frames(level, time_s, count) for level in (0.0, light)]
    results = _reference_results(exposures)
    assert pytest.approx(NOISE.gain_e_per_dn, rel=0.02) == 1.0 / results.K
    # by its line through the variances of all exposures, at none
    assert results.sigma_d == pytest.approx(NOISE.read_noise_e, rel=0.03)
    assert pytest.approx(NOISE.dsnu_e, rel=0.05) == results.DSNU1288
    assert pytest.approx(NOISE.prnu, rel=0.05) == 0.01 * results.PRNU1288
    top = results.index_u_ysat
    signal = results.temporal["u_y"][top] - results.temporal["u_ydark"][top]
    brightest = shares[shares < 1.0].max()  # it takes the flat with the largest variance
    saturation_db = 10.0 * np.log10(brightest * NOISE.white_e)
    assert 10.0 * np.log10(signal / results.K) == pytest.approx(saturation_db, abs=0.2)
