"""Response of a camera: from light to levels, from images of one scene by exposure time.

The scene is static, so the light that a pixel collects is proportional to the exposure time, and
its levels are the response to lights of known ratios. Named transfer functions are compared with
the images first; if none of them fits, a curve is solved for.

Source: Debevec & Malik, "Recovering high dynamic range radiance maps from photographs" (1997).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import MeasurementError
from omnisim.core.srgb import linear_from_srgb
from omnisim.measurement.quantity import Quantity
from omnisim.rendering.camera.degradations.encoding import Encoding

MIN_EXPOSURES = 3
LOW, HIGH = 0.03, 0.97  # levels that count, as shares of the largest one
MIN_BRIGHTEST, MAX_BRIGHTEST = 0.5, 1.001  # share of the largest level
MAX_PIXELS = 20_000
MAX_ERROR = 0.005  # of full scale, beyond what the solved curve leaves, for a named function
_KNOTS = 33  # of the solved curve, dense in the dark
_SMOOTHNESS = 0.1  # weight of the curve's second differences, in pixels


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """Response of a camera."""

    encoding: Encoding  # named transfer function, or a curve
    quantities: tuple[Quantity, ...]  # exponent of the best power function, and error of `encoding`
    errors: dict[str, float]  # root mean square error of each function, as a share of full scale
    light: Floats  # (n,) solved curve: light as a share of the light of white
    levels: Floats  # (n,) its levels in [0, 1]


def measure_response(
    images: Sequence[NDArray[Any]],
    exposures_s: Sequence[float],
    black_dn: float = 0.0,
    white_dn: float = 255.0,
    name: str = "images",
) -> MeasuredResponse:
    """Measure the response of a camera.

    Args:
        images: for each exposure time, (height, width) levels of a static scene: of one image, or
            the mean of several.
        exposures_s: exposure times.
        black_dn, white_dn: level without light, and largest level.
        name: name of the images, for messages.

    Raises:
        MeasurementError: too few exposure times, images of several sizes, a wrong largest level,
            brightness that does not follow the exposure time, or too few levels between black and
            white.
    """
    order = np.argsort(exposures_s)
    times = np.asarray(exposures_s, dtype=np.float64)[order]
    if len(np.unique(times)) < MIN_EXPOSURES:
        raise MeasurementError(
            f"{name}: {len(np.unique(times))} exposure times: expected at least {MIN_EXPOSURES}"
        )
    if len({image.shape for image in images}) > 1:
        raise MeasurementError(f"{name}: images of several sizes: expected one camera")
    steps = [max(1, math.ceil(images[index].size / MAX_PIXELS)) for index in order]
    stack = np.stack([
        images[index].reshape(-1)[::step].astype(np.float64)
        for index, step in zip(order, steps, strict=True)
    ])  # fmt: skip
    levels = (stack - black_dn) / (white_dn - black_dn)
    brightest = float(np.max(levels))
    if not MIN_BRIGHTEST < brightest < MAX_BRIGHTEST:
        raise MeasurementError(
            f"{name}: the brightest pixel is at {100.0 * brightest:.0f} % of white, {white_dn:g}: "
            "expected exposure times up to white, and the camera's own white level"
        )
    means = np.median(levels, axis=1)
    for index in range(1, len(times)):
        if means[index] < means[index - 1] - 0.01:
            raise MeasurementError(
                f"{name}: {1e3 * times[index]:g} ms is darker than {1e3 * times[index - 1]:g} ms: "
                "expected a still scene, constant light, and no automatic exposure"
            )
    used = (levels > LOW) & (levels < HIGH)
    used &= used.sum(axis=0) >= 2
    if used.sum() < 200:
        raise MeasurementError(
            f"{name}: {int(used.sum())} levels between black and white: expected exposure times at "
            "which the scene is neither"
        )
    gamma = _best_gamma(levels, times, used)
    curves: dict[str, Callable[[Floats], Floats]] = {
        "linear": lambda values: values,
        "srgb": lambda values: linear_from_srgb(np.clip(values, 0.0, 1.0)),
        "gamma": lambda values: np.clip(values, 0.0, 1.0) ** gamma,
    }
    knots, light = _solved_curve(levels, times, used)
    curves["curve"] = lambda values: np.interp(values, knots, light)
    errors = {name: _error(curve, levels, times, used) for name, curve in curves.items()}
    best = _simplest(errors)
    encodings = {
        "linear": Encoding(gamma=1.0),
        "srgb": Encoding(gamma="srgb"),
        "gamma": Encoding(gamma=gamma),
        "curve": Encoding(curve=tuple(zip(light.tolist(), knots.tolist(), strict=True))),
    }
    basis = f"{int(used.any(axis=0).sum())} pixels at {len(times)} exposure times"
    # standard deviation of the exponent, from eighths of the pixels; NaN: too few pixels
    parts = [
        _best_gamma(levels[:, start::8], times, used[:, start::8])
        for start in range(8)
        if used[:, start::8].sum() >= 20
    ]
    sigma = float(np.std(parts, ddof=1) / math.sqrt(len(parts))) if len(parts) > 2 else math.nan
    quantities = (
        Quantity("gamma", gamma, sigma, "", f"{basis}, as a power"),
        Quantity("response_error", errors[best], math.nan, "of full scale", f"{basis}, as {best}"),
    )
    return MeasuredResponse(encodings[best], quantities, errors, light, knots)


def _error(
    inverse: Callable[[Floats], Floats], levels: Floats, times: Floats, used: Bools
) -> float:
    """Root mean square error of levels (images, pixels) predicted with an inverse response.

    White is 1; levels that are not `used` are too dark or too bright.
    """
    # of each pixel, from its mean light per second
    weights = used * times[:, None]
    per_second = (inverse(levels) * used).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-30)
    light = per_second * times[:, None]
    # back to levels along the inverse's slope
    grid = np.linspace(0.0, 1.0, 2049)
    expected = np.interp(light, inverse(grid), grid)
    return float(np.sqrt(np.mean(np.square((expected - levels)[used]))))


def _best_gamma(levels: Floats, times: Floats, used: Bools) -> float:
    """Exponent of the power that explains the levels best."""

    def error(gamma: float) -> float:
        return _error(lambda values: np.clip(values, 0.0, 1.0) ** gamma, levels, times, used)

    return float(minimize_scalar(error, bounds=(0.3, 4.0), method="bounded").x)


def _simplest(errors: dict[str, float]) -> str:
    """Name of the function with the smallest error, or of a simpler one that is nearly as good."""
    for name in ("linear", "srgb"):
        if errors[name] <= 1.05 * min(errors["gamma"], errors[name]) + 2e-4:
            break
    else:
        name = "gamma"
    limit = math.hypot(errors["curve"], MAX_ERROR)
    return name if errors[name] <= limit else "curve"


def _solved_curve(levels: Floats, times: Floats, used: Bools) -> tuple[Floats, Floats]:
    """Levels (n,) of the knots, from 0 to 1, and their light (n,), 1 at the last knot.

    The logarithm of the light is the logarithm of the level plus a function that is linear between
    knots. Subtracting the weighted mean of a pixel's equations eliminates that pixel's light.
    """
    knots = np.linspace(0.0, 1.0, _KNOTS) ** 2
    weights = np.where(used, levels, 0.0) ** 2  # noise of a logarithm falls with the level
    normal = np.zeros((_KNOTS, _KNOTS))
    right = np.zeros(_KNOTS)
    total = np.maximum(weights.sum(axis=0), 1e-30)
    known = np.log(times)[:, None] - np.log(np.clip(levels, 1e-6, None))
    known -= (weights * known).sum(axis=0) / total
    rows = np.zeros((len(times), levels.shape[1], _KNOTS))
    index = np.clip(np.searchsorted(knots, levels, side="right") - 1, 0, _KNOTS - 2)
    share = np.clip((levels - knots[index]) / (knots[index + 1] - knots[index]), 0.0, 1.0)
    np.put_along_axis(rows, index[..., None], 1.0 - share[..., None], axis=2)
    np.put_along_axis(rows, index[..., None] + 1, share[..., None], axis=2)
    rows -= (weights[..., None] * rows).sum(axis=0) / total[:, None]
    for row, value, weight in zip(rows, known, weights, strict=True):
        normal += row.T @ (weight[:, None] * row)
        right += row.T @ (weight * value)
    bend = np.diff(np.eye(_KNOTS), 2, axis=0)
    normal += _SMOOTHNESS * bend.T @ bend
    normal[-1, -1] += 1.0  # the light of white is 1: its logarithm is 0
    offsets = np.linalg.solve(normal, right)
    light = knots * np.exp(offsets - offsets[-1])
    rising: Floats = np.maximum.accumulate(light + 1e-9 * np.arange(_KNOTS))
    return knots, rising / rising[-1]
