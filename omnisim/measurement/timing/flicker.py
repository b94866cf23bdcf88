"""Readout time of a rolling shutter, from the bands that a flickering lamp leaves in images.

A lamp of f Hz lights row r of a frame by 1 + m cos(2π f (t + r τ) + φ), with the line time τ. The
scene is the same in all frames, and the bands differ. The number of rows per band gives τ.

Source: Rife & Boorstyn, "Single-tone parameter estimation from discrete-time observations" (1974),
for the initial frequency, from the peak of the periodogram.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares

from omnisim.core.arrays import Floats
from omnisim.core.errors import MeasurementError
from omnisim.measurement.quantity import Quantity, Unobservable

MIN_FRAMES = 5
MIN_PERIODS = 0.75  # of the flicker in a frame
MIN_SAMPLES = 4.0  # rows per period
MIN_RATIO = 12.0  # of the bands' power to the median of all frequencies
MAX_REST = 0.01  # power of another frequency, as a share of that of the bands
MIN_FLICKER = 0.005  # share of the light
MAX_CLIPPED = 0.01
_FINE = 8  # steps of the search per independent frequency


class LineProfiles(NamedTuple):
    """Light of the rows and columns of frames."""

    rows: Floats  # (frames, height) mean light of each row
    columns: Floats  # (frames, width) mean light of each column


@dataclass(frozen=True, eq=False)
class MeasuredTiming:
    """Timing of a camera."""

    readout_s: float  # time from the first to the last line; 0: a global shutter
    lines: str  # "rows" or "columns": the lines that are read out one after another
    # readout, line time, flicker and exposure, as far as they are determined
    quantities: tuple[Quantity, ...]
    unobservable: tuple[Unobservable, ...]  # quantities that the frames do not determine
    # profile, fitted: (frames, lines) light of each line, divided by the scene's light, and fitted
    # bands, for plots
    profile: Floats
    fitted: Floats


def line_profiles(
    frames: Iterable[NDArray[Any]], white: float, name: str = "frames"
) -> LineProfiles:
    """Light of the rows and columns of frames (height, width) of linear levels up to `white`.

    Only one frame is in memory at a time; `name` is for messages.

    Raises:
        MeasurementError: frames of several sizes, clipped frames, or too few frames.
    """
    rows, columns, size = [], [], None
    for frame in frames:
        size = frame.shape if size is None else size
        if frame.shape != size:
            raise MeasurementError(f"{name}: frames of several sizes: expected one camera")
        clipped = float(np.mean(frame >= 0.995 * white))
        if clipped > MAX_CLIPPED:
            raise MeasurementError(
                f"{name}: {100.0 * clipped:.0f} % of the pixels are white: expected less light"
            )
        rows.append(frame.mean(axis=1, dtype=np.float64))
        columns.append(frame.mean(axis=0, dtype=np.float64))
    if len(rows) < MIN_FRAMES:
        raise MeasurementError(f"{name}: {len(rows)} frames: expected at least {MIN_FRAMES}")
    return LineProfiles(np.array(rows), np.array(columns))


def measure_timing(
    profiles: LineProfiles,
    flicker_hz: float,
    lamp_modulation: float | None = None,
    name: str = "frames",
) -> MeasuredTiming:
    """Measure readout and, for a lamp of known modulation, exposure time.

    Args:
        profiles, name: light of the lines of several frames, and their name for messages.
        flicker_hz: frequency of the light: twice the mains frequency, or the LED driver's.
        lamp_modulation: amplitude of the lamp's light over its mean, above 0, at most 1; None:
            unknown, and the exposure time is not measured.

    Raises:
        MeasurementError: a frequency or a modulation out of range, no flicker, less than 0.75 of
            its periods in a frame, or a scene that moves.
    """
    if not flicker_hz > 0.0:
        raise MeasurementError(f"flicker: expected a frequency above 0 Hz, got {flicker_hz:g}")
    if lamp_modulation is not None and not 0.0 < lamp_modulation <= 1.0:
        raise MeasurementError(
            f"modulation: expected more than 0, at most 1, got {lamp_modulation:g}"
        )
    both = {"rows": profiles.rows, "columns": profiles.columns}
    peaks = {lines: _peak(_without_scene(light)) for lines, light in both.items()}
    lines = max(peaks, key=lambda axis: peaks[axis].ratio)
    light = both[lines]
    if peaks[lines].ratio < MIN_RATIO:
        return _global_shutter(profiles, flicker_hz, name)
    bands = _fit(light, peaks[lines].frequency)
    _check_scene(bands, name)
    count = light.shape[1]
    periods = bands.frequency * (count - 1)
    if periods < MIN_PERIODS:
        raise MeasurementError(
            f"{name}: {periods:.2f} of a flicker's period in a frame: expected {MIN_PERIODS:g} or "
            f"more: use a lamp that flickers faster than {flicker_hz:g} Hz"
        )
    line_s, sigma_s = (value / flicker_hz for value in (bands.frequency, bands.sigma))
    basis = f"{len(light)} frames of {count} {lines}, {periods:.2f} periods of {flicker_hz:g} Hz"
    readout_s = line_s * (count - 1)
    quantities = [
        Quantity("readout_s", readout_s, sigma_s * (count - 1), "s", basis),
        Quantity("line_s", line_s, sigma_s, "s", basis),
        Quantity("modulation", bands.modulation, bands.modulation_sigma, "", basis),
    ]
    reason = "bands look the same from top to bottom and from bottom to top: photograph something "
    unobservable = [Unobservable("readout_direction", f"{reason}that turns")]
    exposure = _exposure(bands, lamp_modulation, flicker_hz, basis)
    (quantities if isinstance(exposure, Quantity) else unobservable).append(exposure)  # type: ignore[arg-type]
    return MeasuredTiming(
        readout_s, lines, tuple(quantities), tuple(unobservable), bands.profile, bands.fitted
    )


def _check_scene(bands: _Bands, name: str) -> None:
    """Reject frames that differ by more than bands and their harmonics, as of a pulsed lamp."""
    rest = _powers(1.0 + bands.profile - bands.fitted)
    order = np.arange(len(rest)) / (_FINE * bands.profile.shape[1] * bands.frequency)
    harmonic = np.rint(order)
    width = 1.0 / (bands.profile.shape[1] * bands.frequency)  # of a line of the spectrum
    rest[(harmonic >= 2.0) & (np.abs(order - harmonic) <= width)] = 0.0
    share = float(rest.max() / _powers(bands.profile).max())
    if share > MAX_REST:
        raise MeasurementError(
            f"{name}: the frames differ by more than bands, which leave {100.0 * share:.0f} % of "
            "their power at another frequency: expected a still surface and a still camera"
        )


class _Peak(NamedTuple):
    """Strongest frequency of bands, periods per line; its power over the median power."""

    frequency: float
    ratio: float


class _Bands(NamedTuple):
    """Fitted bands."""

    frequency: float  # periods per line
    sigma: float  # standard deviation of the frequency
    modulation: float  # amplitude as a share of the mean light
    modulation_sigma: float
    profile: Floats  # (frames, lines) light divided by the scene's light
    fitted: Floats  # (frames, lines) fitted bands


def _without_scene(light: Floats) -> Floats:
    """Light (frames, lines), divided by each frame's mean, then by the mean frame (the scene)."""
    frames = light / light.mean(axis=1, keepdims=True)
    return frames / np.maximum(frames.mean(axis=0), 1e-9)


def _peak(profile: Floats) -> _Peak:
    """Strongest frequency of the power spectrum summed over the frames."""
    power = _powers(profile)
    best = int(np.argmax(power))
    noise = float(np.median(power[power > 0.0])) + 1e-30
    return _Peak(best / (_FINE * profile.shape[1]), float(power[best]) / noise)


def _powers(profile: Floats) -> Floats:
    """Power by frequency, in steps of 1 / (8 lines), summed over the frames."""
    count = profile.shape[1]
    padded = _FINE * count
    power: Floats = np.square(np.abs(np.fft.rfft(profile - 1.0, padded, axis=1))).sum(axis=0)
    power[np.arange(len(power)) < 0.5 * _FINE] = 0.0  # drift of the light, removed with the means
    return power


def _fit(light: Floats, frequency: float) -> _Bands:
    """Fit a common frequency, and for each frame a gain and the amplitudes of cosine and sine.

    Unless the bands of the frames cancel, the mean of all frames has bands, too. The model is
    therefore the ratio of a frame's bands to their mean over all frames.
    """
    profile = _without_scene(light)
    frames, count = profile.shape
    position = np.arange(count) - 0.5 * (count - 1)
    scale = 1.0 / count  # of a change of the frequency

    def ratios(vector: Floats) -> Floats:
        angle = 2.0 * math.pi * (frequency + scale * vector[0]) * position
        cosine, sine = vector[1 : 2 * frames + 1].reshape(2, frames)
        gain = np.concatenate(([1.0], vector[2 * frames + 1 :]))
        bands = 1.0 + cosine[:, None] * np.cos(angle) + sine[:, None] * np.sin(angle)
        lit: Floats = gain[:, None] * bands
        lit /= lit.mean(axis=0)
        return lit

    def errors(vector: Floats) -> Floats:
        return (ratios(vector) - profile).ravel()

    # amplitudes (2, frames) of cosine and sine in the bands of each frame
    angle = 2.0 * math.pi * frequency * position
    design = np.stack((np.ones_like(angle), np.cos(angle), np.sin(angle)), axis=1)
    amplitudes = np.linalg.lstsq(design, profile.T, rcond=None)[0][1:]
    start = np.concatenate(([0.0], *amplitudes, np.ones(frames - 1)))
    solution = least_squares(errors, start, x_scale="jac", method="trf")
    jacobian, residuals = np.asarray(solution.jac), solution.fun
    variance = float(residuals @ residuals) / max(profile.size - len(start) - count, 1)
    sizes = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.pinv((jacobian / sizes).T @ (jacobian / sizes), rcond=1e-12)
    sigmas = np.sqrt(np.diagonal(inverse) * variance) / sizes
    amplitudes = solution.x[1 : 2 * frames + 1].reshape(2, frames)
    modulation = math.sqrt(float(np.square(amplitudes).sum()) / frames)
    fitted, sigma = frequency + scale * float(solution.x[0]), scale * float(sigmas[0])
    modulation_sigma = math.sqrt(2.0 * variance / profile.size)
    return _Bands(fitted, sigma, modulation, modulation_sigma, profile, ratios(solution.x))


def _exposure(
    bands: _Bands, lamp: float | None, flicker_hz: float, basis: str
) -> Quantity | Unobservable:
    """Exposure time T from the modulation of the bands, m = m₀ |sinc(f T)|, with the lamp's m₀."""
    if lamp is None:
        reason = (
            "the lamp's own modulation is unknown: measure it with a photodiode, or in images of a "
            "short exposure"
        )
        return Unobservable("exposure_s", reason)
    share = bands.modulation / lamp
    if share > 1.0 + 4.0 * bands.modulation_sigma / lamp:
        reason = (
            f"bands of {bands.modulation:.3g} are stronger than the lamp's modulation of {lamp:g}"
        )
        return Unobservable("exposure_s", reason)
    cycles, step = 0.0, 1e-6
    if share < 1.0:
        cycles = float(brentq(lambda cycles: np.sinc(cycles) - share, 0.0, 1.0))
    slope = abs(float((np.sinc(cycles + step) - np.sinc(cycles - step)) / (2.0 * step)))
    sigma_s = bands.modulation_sigma / lamp / max(slope, 1e-6) / flicker_hz
    note = f"{basis}, for an exposure shorter than a period"
    return Quantity("exposure_s", cycles / flicker_hz, sigma_s, "s", note)


def _global_shutter(profiles: LineProfiles, flicker_hz: float, name: str) -> MeasuredTiming:
    """Timing of a camera whose frames change as a whole; rejects frames that are equally bright."""
    means = profiles.rows.mean(axis=1)
    flicker = float(means.std() / means.mean())
    if flicker < MIN_FLICKER:
        raise MeasurementError(
            f"{name}: no bands, and all frames are equally bright to {100.0 * flicker:.2f} %: "
            "expected a flickering lamp, an exposure that is no multiple of its period, and a "
            "frame rate that is not in step with it"
        )
    basis = f"{len(means)} frames that flicker by {100.0 * flicker:.1f} % as a whole, without bands"
    profile = _without_scene(profiles.rows)
    readout = Quantity("readout_s", 0.0, math.nan, "s", basis)
    reason = f"no bands under {flicker_hz:g} Hz: the shutter is global"
    exposure = Unobservable("exposure_s", reason)
    fitted = np.ones_like(profile)
    return MeasuredTiming(0.0, "rows", (readout,), (exposure,), profile, fitted)
