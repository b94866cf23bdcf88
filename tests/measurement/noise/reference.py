"""Evaluation of frames by the reference implementation of EMVA 1288."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

Frames = Sequence[NDArray[Any]]


@dataclass(frozen=True)
class ReferenceResults:
    """Noise by the reference implementation."""

    gain_e_per_dn: float
    dark_noise_e: float  # without light or exposure
    dsnu_e: float
    prnu: float
    max_snr_db: float  # at saturation


def reference_results(exposures: Mapping[float, tuple[Frames, Frames]]) -> ReferenceResults:
    """Evaluate raw frames.

    Args:
        exposures: dark and flat frames by exposure time in seconds. The exposure with the most
            frames also determines the nonuniformities.
    """
    from emva1288.process.data import Data1288
    from emva1288.process.results import Results1288
    from emva1288.process.routines import get_int_imgs

    temporal: dict[float, dict[float, Any]] = {}
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
    with _float_arrays():
        data = {"temporal": temporal, "spatial": spatial, "width": width, "height": height}
        results = Results1288(Data1288(data).data)
        top = results.index_u_ysat
        signal = results.temporal["u_y"][top] - results.temporal["u_ydark"][top]
        return ReferenceResults(
            gain_e_per_dn=1.0 / float(results.K),
            dark_noise_e=float(results.sigma_d),
            dsnu_e=float(results.DSNU1288),
            prnu=0.01 * float(results.PRNU1288),
            max_snr_db=float(10.0 * np.log10(signal / results.K)),
        )


@contextmanager
def _float_arrays() -> Iterator[None]:
    """Restore NumPy's `asfarray`, which the reference implementation calls and NumPy 2 dropped."""
    if hasattr(np, "asfarray"):
        yield
        return
    vars(np)["asfarray"] = partial(np.asarray, dtype=float)
    try:
        yield
    finally:
        del vars(np)["asfarray"]
