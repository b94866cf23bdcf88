"""Noise parameters of a camera, from statistics of dark frames and flat fields.

Source: EMVA Standard 1288, release 4.0, for names, definitions and the linear model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Ints
from omnisim.core.errors import MeasurementError
from omnisim.measurement import Quantity, Unobservable
from omnisim.measurement.noise.frame_statistics import FrameStatistics
from omnisim.rendering.camera.degradations import Noise

MAX_ZEROS = 0.005  # share of dark values at 0, EMVA 1288
MIN_VARIANCE_DN2 = 0.24  # below it quantization hides the noise, EMVA 1288
MAX_LEAK = 0.01  # of the range: difference of mean dark values over the image
QUANTIZATION_DN2 = 1.0 / 12.0
_LEAK_BLOCKS = 8
_LEAK_SIGMAS = 8.0  # the range of 64 normal numbers is below it but once in a million
_SIGNIFICANT = 3.0  # standard deviations


@dataclass(frozen=True, eq=False)
class MeasuredNoise:
    """Noise of a camera."""

    noise: Noise  # noise parameters for the sensor file, without the pattern
    quantities: tuple[Quantity, ...]  # measured quantities with their standard deviations
    unobservable: tuple[Unobservable, ...]  # quantities that the frames do not determine
    curve: PhotonTransfer  # photon transfer curve
    # (height, width, 2) float32: deviation of each pixel's gain as a share, and of its dark signal
    # in electrons; None: too few frames
    pattern: Floats32 | None
    defects: Ints  # (n, 2) row and column of defective pixels
    exposure_s: float  # exposure time of the frames used to measure the pattern


def measure_noise(
    darks: Sequence[FrameStatistics],
    flats: Sequence[FrameStatistics],
    *,
    bit_depth: int | None = None,
    mosaic: bool = False,
) -> MeasuredNoise:
    """Measure the noise of a camera.

    Args:
        darks: dark frames, at one exposure or more.
        flats: evenly lit frames at three levels or more; the brightest level below 70 % of
            saturation must be at least four times the darkest.
        bit_depth: bits of the converter; None: the number of bits that the values use.
        mosaic: the frames have a Bayer mosaic.

    Raises:
        MeasurementError: no frames, several sizes, dark frames that are clipped or lit, flats that
            saturate or are not linear, or too few levels.
    """
    if not darks or not flats:
        missing = "flat" if darks else "dark"
        raise MeasurementError(f"expected dark and flat frames, got no {missing} ones")
    darks, flats, bits = _aligned(darks, flats, bit_depth)
    largest_dn = float((1 << bits) - 1)
    for frames in darks:
        _check_dark(frames, largest_dn)
    dark = dark_signal(darks)
    curve = photon_transfer(flats, dark)
    result = _Collector(curve, dark, largest_dn, mosaic)
    result.gain()
    result.dark()
    result.saturation()
    # the flat with enough frames nearest to 50 % of saturation
    end_dn = curve.saturation_dn
    end_dn = max(frames.mean_dn for frames in flats) if end_dn is None else end_dn
    stacks = [
        frames for frames in flats if frames.count >= MIN_FRAMES and frames.mean_dn < 0.9 * end_dn
    ]
    middle_dn = 0.5 * (dark.black_dn + end_dn)
    flat = min(stacks, key=lambda frames: abs(frames.mean_dn - middle_dn), default=None)
    stack = max(darks, key=lambda frames: frames.count)
    result.pattern(stack, flat)
    return MeasuredNoise(
        noise=Noise(bit_depth=bits, **result.parameters), quantities=tuple(result.quantities),
        unobservable=tuple(result.unobservable), curve=curve, pattern=result.map,
        defects=result.defects, exposure_s=(flat or stack).exposure_s,
    )  # fmt: skip


def _aligned(
    darks: Sequence[FrameStatistics], flats: Sequence[FrameStatistics], bit_depth: int | None
) -> tuple[list[FrameStatistics], list[FrameStatistics], int]:
    """Statistics in units of the converter's steps, and the converter's number of bits."""
    everything = [*darks, *flats]
    first = everything[0]
    bits = 0
    for frames in everything:
        bits |= frames.bits
        if frames.mean_image_dn.shape != first.mean_image_dn.shape:
            height, width = frames.mean_image_dn.shape
            expected = f"{first.mean_image_dn.shape[1]} × {first.mean_image_dn.shape[0]} px"
            raise MeasurementError(
                f"{frames.name}: expected {expected} as in {first.name}, got {width} × {height} px"
            )
    if bits == 0:
        raise MeasurementError(f"{first.name} and others: expected light in the flats, got zeros")
    shift = (bits & -bits).bit_length() - 1  # values at the upper end of 16 bits
    used = (bits >> shift).bit_length()
    if bit_depth is not None and used > bit_depth:
        raise MeasurementError(f"bit depth {bit_depth}: expected at least {used}, as in the values")
    shifted = [[frame.shifted(shift) for frame in frames] for frames in (darks, flats)]
    return shifted[0], shifted[1], bit_depth or used


def _check_dark(dark: FrameStatistics, largest_dn: float) -> None:
    if dark.zeros > MAX_ZEROS:
        raise MeasurementError(
            f"{dark.name}: expected at most {100 * MAX_ZEROS:g} % of the dark values at 0, got "
            f"{100 * dark.zeros:.2g} %: raise the camera's black level"
        )
    # means of 8 × 8 equal blocks, of fewer if there are fewer rows or columns
    image = dark.mean_image_dn
    rows, columns = (min(_LEAK_BLOCKS, size) for size in image.shape)
    blocks = np.array(
        [
            [part.mean() for part in np.array_split(strip, columns, axis=1)]
            for strip in np.array_split(image, rows, axis=0)
        ]
    )
    leak = float(np.ptp(blocks))
    noise = float(np.std(image)) / math.sqrt(image.size / blocks.size)
    if leak > MAX_LEAK * largest_dn + _LEAK_SIGMAS * noise:
        row, column = np.unravel_index(int(np.argmax(blocks)), blocks.shape)
        side = "upper" if row < len(blocks) / 2 else "lower"
        side += " left" if column < blocks.shape[1] / 2 else " right"
        raise MeasurementError(
            f"{dark.name}: expected even dark frames, got {leak:.3g} DN more at the {side}: light "
            "leaks in, cover the lens"
        )


class _Collector:
    """Parameters, quantities and unobservable quantities, in the order of their measurement."""

    def __init__(self, curve: PhotonTransfer, dark: DarkSignal, largest_dn: float, mosaic: bool):
        self._curve, self._dark, self._largest_dn, self._mosaic = curve, dark, largest_dn, mosaic
        self._gain = 1.0 / curve.gain_dn_per_e
        self._gain_share = curve.gain_sigma_dn_per_e / curve.gain_dn_per_e
        self.parameters: dict[str, Any] = {}
        self.quantities: list[Quantity] = []
        self.unobservable: list[Unobservable] = []
        self.map: Floats32 | None = None
        self.defects = np.zeros((0, 2), dtype=np.int64)

    def gain(self) -> None:
        """Measure the gain of the converter."""
        basis = f"slope of the temporal variance over {self._curve.used.sum()} flat levels"
        self._add("gain_e_per_dn", self._gain, self._gain * self._gain_share, "e/DN", basis)

    def dark(self) -> None:
        """Measure black level, dark current and read noise."""
        dark, gain = self._dark, self._gain
        count = sum(frame.count for frame in dark.frames)
        black = dark.black_dn
        exposures = len(dark.frames)
        frames = f"{count} dark frames at {exposures} exposure{'s' if exposures > 1 else ''}"
        rate_e, rate_sigma = gain * dark.rate_dn_per_s, gain * dark.rate_sigma_dn_per_s
        if not math.isfinite(rate_sigma):
            self._miss("dark_current_e_per_s", "take dark frames at two exposures or more")
        elif rate_e < _SIGNIFICANT * rate_sigma:
            limit = f"below {max(rate_e, 0.0) + 2.0 * rate_sigma:.3g} e/s"
            self._miss("dark_current_e_per_s", f"{limit}: take dark frames at longer exposures")
        else:
            sigma = math.hypot(rate_sigma, rate_e * self._gain_share)
            self._add("dark_current_e_per_s", rate_e, sigma, "e/s", f"growth over {frames}")
        self._add("black_level_dn", black, dark.black_sigma_dn, "DN", f"mean of {frames}")
        variances = np.array([frame.variance_dn2 for frame in dark.frames])
        sigmas = np.array([frame.variance_sigma_dn2 for frame in dark.frames])
        # electrons of the dark current have shot noise of their own
        growth = np.array([dark.rate_dn_per_s * frame.exposure_s for frame in dark.frames])
        read = variances - QUANTIZATION_DN2 - np.maximum(growth, 0.0) / gain
        weights = np.maximum(sigmas, 1e-12) ** -2
        read_dn2 = float(np.average(read, weights=weights))
        sigma_dn2 = float(weights.sum() ** -0.5)
        if float(np.average(variances, weights=weights)) < MIN_VARIANCE_DN2:
            most_e = gain * math.sqrt(MIN_VARIANCE_DN2)
            reason = f"below {most_e:.2g} e, hidden by quantization: raise the gain"
        elif read_dn2 < _SIGNIFICANT * sigma_dn2:
            most_e = gain * math.sqrt(max(read_dn2, 0.0) + 2.0 * sigma_dn2)
            reason = f"below {most_e:.2g} e, hidden by the dark current: take shorter dark frames"
        else:
            reason = ""
        if reason:
            self.parameters["read_noise_e"] = gain * math.sqrt(max(read_dn2, 0.0))
            self._miss("read_noise_e", reason)
            return
        read_dn = math.sqrt(read_dn2)
        sigma_dn = sigma_dn2 / (2.0 * read_dn)
        sigma = gain * math.hypot(sigma_dn, read_dn * self._gain_share)
        self._add("read_noise_e", gain * read_dn, sigma, "e", f"temporal variance of {frames}")

    def saturation(self) -> None:
        """Measure the saturation capacity: of the pixel's well or the converter, the smaller."""
        end_dn = self._curve.saturation_dn
        if end_dn is None:
            brightest = float(self._curve.means_dn.max())
            limit = f"above {self._gain * brightest:.4g} e"
            self._miss("full_well_e", f"{limit}: take a flat that saturates all pixels")
            white_dn = self._largest_dn - self._dark.black_dn
            self.parameters["full_well_e"] = self._gain * white_dn
            return
        well_e = self._gain * (end_dn - self._dark.black_dn)
        at_end = end_dn > self._largest_dn - 1.0
        by = "limited by the converter" if at_end else "limited by the pixels' full wells"
        basis = f"saturation at {end_dn:.0f} DN, {by}"
        self._add("full_well_e", well_e, well_e * self._gain_share, "e", basis)

    def pattern(self, dark: FrameStatistics, flat: FrameStatistics | None) -> None:
        """Measure both nonuniformities and the map of deviations, and find defective pixels."""
        few = f"take {MIN_FRAMES} frames or more"
        if dark.count < MIN_FRAMES:
            self._miss("dsnu_e", f"{few} in the dark")
            self._miss("prnu", few)
            return
        noise_dn2 = dark.variance_dn2 / dark.count
        dsnu = _nonuniformity(dark.mean_image_dn - dark.mean_dn, noise_dn2)
        gain = self._gain
        self._add_parts("dsnu_e", dsnu, gain, "e", f"{dark.count} dark frames")
        if flat is None:
            self._miss("prnu", f"{few} of a flat near 50 % of saturation")
            self.defects = dsnu.defects
            return
        prnu = photo_response_nonuniformity(flat, dark, self._dark, self._mosaic)
        self._add_parts("prnu", prnu, 1.0, "", f"{flat.count} flat fields")
        self.map = np.stack((prnu.pattern, gain * dsnu.pattern), axis=-1).astype(np.float32)
        self.map[..., 0] = np.maximum(self.map[..., 0], np.float32(-1.0))  # at least no response
        self.defects = np.unique(np.concatenate((dsnu.defects, prnu.defects)), axis=0)

    def _add_parts(
        self, name: str, spread: Nonuniformity, factor: float, unit: str, basis: str
    ) -> None:
        of_gain = spread.total * self._gain_share if factor != 1.0 else 0.0
        sigma = factor * math.hypot(spread.sigma, of_gain)
        if spread.total < _SIGNIFICANT * spread.sigma:
            limit = factor * (spread.total + 2.0 * spread.sigma)
            self._miss(name, f"below {limit:.2g} {unit}: take more frames")
            return
        self._add(name, factor * spread.total, sigma, unit, basis)
        stem, ending = (name[:-2], "_e") if name.endswith("_e") else (name, "")
        for part in ("row", "column", "pixel"):
            named, value = f"{stem}_{part}{ending}", factor * getattr(spread, part)
            self.quantities.append(Quantity(named, value, math.nan, unit, basis))

    def _add(self, name: str, value: float, sigma: float, unit: str, basis: str) -> None:
        self.parameters[name] = value
        self.quantities.append(Quantity(name, value, sigma, unit, basis))

    def _miss(self, name: str, reason: str) -> None:
        self.unobservable.append(Unobservable(name, reason))


# Photon transfer: temporal variance against mean, whose slope is the gain of the camera.
#
# Source: EMVA Standard 1288, release 4.0, section 6.6 (gain from the range up to 70 % of
# saturation) and Janesick, "Photon Transfer", SPIE, 2007.


MAX_SHARE = 0.7  # of saturation, EMVA 1288
MIN_LEVELS = 3
MAX_CLIPPED = 1e-3  # share of values at the largest number
MIN_SPAN = 4.0  # ratio of the brightest to the darkest level
MAX_EXPONENT_ERROR = 0.05  # of the mean's growth with the exposure time
MAX_CURVATURE = 0.15  # change of the slope over the range, as a share of the slope
# Saturated levels: their variance is below this share of the largest one, their mean above this
# share of the brightest one.
_PLATEAU, _NEAR_END = 0.5, 0.9
_BEYOND_PEAK = 3.0  # growth of the mean past the largest variance that uneven light explains
_LINEAR = "save linear (raw) frames without gamma, sharpening or denoising"


@dataclass(frozen=True, eq=False)
class DarkSignal:
    """Dark frames by exposure: mean = black_dn + rate_dn_per_s · exposure."""

    black_dn: float  # mean of a frame of zero exposure
    black_sigma_dn: float
    rate_dn_per_s: float  # growth of the mean; 0 for one exposure
    rate_sigma_dn_per_s: float  # infinite for one exposure
    frames: tuple[FrameStatistics, ...]

    def mean_dn(self, exposure_s: float) -> float:
        """Mean dark value at an exposure: of frames with that exposure, else by the line."""
        for frame in self.frames:
            if np.isclose(frame.exposure_s, exposure_s, rtol=1e-6):
                return frame.mean_dn
        return self.black_dn + self.rate_dn_per_s * exposure_s

    def variance_dn2(self, exposure_s: float) -> float:
        """Temporal variance of the dark frames whose exposure is nearest to `exposure_s`."""
        return min(self.frames, key=lambda frames: abs(frames.exposure_s - exposure_s)).variance_dn2


def dark_signal(darks: Sequence[FrameStatistics]) -> DarkSignal:
    """Fit a line to the means of dark frames over exposure, weighted by their precision."""
    times = np.array([dark.exposure_s for dark in darks])
    means = np.array([dark.mean_dn for dark in darks])
    pixels = np.array([dark.mean_image_dn.size * dark.count for dark in darks])
    sigmas = np.sqrt(np.maximum([dark.variance_dn2 for dark in darks], 1.0 / 12.0) / pixels)
    if np.ptp(times) == 0.0:
        black = float(np.average(means, weights=sigmas**-2))
        return DarkSignal(black, float(np.min(sigmas)), 0.0, np.inf, tuple(darks))
    line, covariance = _line(times, means, sigmas)
    sigma = np.sqrt(np.diag(covariance))
    return DarkSignal(line[0], float(sigma[0]), line[1], float(sigma[1]), tuple(darks))


@dataclass(frozen=True, eq=False)
class PhotonTransfer:
    """Photon transfer curve."""

    # means_dn, variances_dn2: (levels,) means and variances, minus those of the dark frames
    means_dn: Floats
    variances_dn2: Floats
    used: Bools  # (levels,) True: the level is part of the fit
    # gain_dn_per_e, gain_sigma_dn_per_e: slope of the curve, and its standard deviation
    gain_dn_per_e: float
    gain_sigma_dn_per_e: float
    saturation_dn: float | None  # mean of the brightest saturated level; None: no level saturates


def photon_transfer(flats: Sequence[FrameStatistics], dark: DarkSignal) -> PhotonTransfer:
    """Fit the photon transfer curve of flat fields.

    Raises:
        MeasurementError: flats darker than the dark frames, too few levels below saturation, levels
            that are too close to each other, or frames that are not linear in the light.
    """
    ordered = sorted(flats, key=lambda frames: frames.mean_dn)
    times = np.array([frames.exposure_s for frames in ordered])
    means = np.array([frames.mean_dn - dark.mean_dn(frames.exposure_s) for frames in ordered])
    variances = np.array(
        [frames.variance_dn2 - dark.variance_dn2(frames.exposure_s) for frames in ordered]
    )
    sigmas = np.array([frames.variance_sigma_dn2 for frames in ordered])
    peak = int(np.argmax(variances))
    saturated = np.arange(len(ordered)) > peak
    saturated &= (variances < _PLATEAU * variances[peak]) & (means > _NEAR_END * means.max())
    at_end = (frames.mean_dn for frames, is_end in zip(ordered, saturated, strict=True) if is_end)
    end_dn = max(at_end, default=None)
    first = f"{ordered[0].name} and others"
    if means[-1] <= 0.0:
        raise MeasurementError(
            f"{ordered[-1].name} and others: expected flats brighter than the dark frames"
        )
    if means[-1] > _BEYOND_PEAK * means[peak]:
        raise MeasurementError(
            f"flats: the variance falls while the mean grows from {means[peak]:.4g} to "
            f"{means[-1]:.4g} DN, expected growth of both: {_LINEAR}"
        )
    # uneven light saturates in some pixels first: from the level with the largest variance on
    limit = np.inf if peak == len(ordered) - 1 else MAX_SHARE * float(means[peak])
    largest = max(frames.maximum_dn for frames in ordered)
    is_clipped = [
        frames.maximum_dn >= largest and frames.clipped > MAX_CLIPPED for frames in ordered
    ]
    used = (means <= limit) & (means > 0.0) & ~saturated & ~np.array(is_clipped)
    if used.sum() < MIN_LEVELS:
        raise MeasurementError(
            f"{first}: expected at least {MIN_LEVELS} flat levels below "
            f"{100 * MAX_SHARE:.0f} % of saturation, got {used.sum()} of {len(ordered)}: "
            "take flats at shorter exposures"
        )
    span = means[used].max() / means[used].min()
    if span < MIN_SPAN:
        raise MeasurementError(
            f"{first}: expected flat levels that span a ratio of {MIN_SPAN:g}, got "
            f"{span:.2g}: take flats at more different exposures"
        )
    _check_linear(times[used], means[used])
    x, y, weights = means[used], variances[used], sigmas[used] ** -2
    gain = float((weights * x * y).sum() / (weights * x * x).sum())  # through the origin
    residual = (y - gain * x) / sigmas[used]
    excess = max(1.0, float(residual @ residual) / max(len(x) - 1, 1))
    gain_sigma = float(np.sqrt(excess / (weights * x * x).sum()))
    _check_curvature(x, y, sigmas[used], gain)
    return PhotonTransfer(means, variances, used, gain, gain_sigma, end_dn)


def _check_linear(times: Floats, means: Floats) -> None:
    """Reject means that are not proportional to the exposure time, if there are three times."""
    if len(np.unique(times)) < MIN_LEVELS:
        return
    exponent = float(np.polyfit(np.log(times), np.log(means), 1)[0])
    if abs(exponent - 1.0) > MAX_EXPONENT_ERROR:
        raise MeasurementError(
            f"flats: the mean grows as the exposure time to the power of {exponent:.2f}, expected "
            f"1, with the same light and no automatic gain: {_LINEAR}"
        )


def _check_curvature(means: Floats, variances: Floats, sigmas: Floats, gain: float) -> None:
    """Refuse a variance that is not proportional to the mean."""
    if len(means) <= MIN_LEVELS:
        return
    ratio, ratio_sigma = variances / means, sigmas / means
    line, covariance = _line(means / means.max(), ratio, ratio_sigma)
    change, sigma = line[1] / gain, np.sqrt(covariance[1, 1]) / gain
    if abs(change) > MAX_CURVATURE + 3.0 * sigma:
        raise MeasurementError(
            f"flats: the variance per mean changes by {100 * change:.0f} % over the levels, "
            f"expected less than {100 * MAX_CURVATURE:.0f} %: {_LINEAR}"
        )


def _line(x: Floats, y: Floats, sigmas: Floats) -> tuple[Floats, Floats]:
    """Intercept and slope (2,) of a weighted line, and their covariance (2, 2)."""
    design = np.stack((np.ones_like(x), x), axis=1) / sigmas[:, None]
    covariance = np.linalg.inv(design.T @ design)
    line: Floats = covariance @ design.T @ (y / sigmas)
    residual = y / sigmas - design @ line
    excess = max(1.0, float(residual @ residual) / max(len(x) - 2, 1))
    return line, np.asarray(covariance * excess, dtype=np.float64)


# Fixed pattern of a sensor, from mean images of many dark frames and flat fields.
#
# Source: EMVA Standard 1288, release 4.0, section 8: spatial variance split into row, column and
# pixel variances, after subtracting the temporal noise that remains in a mean image.


MIN_FRAMES = 16  # of a mean image; EMVA 1288 recommends more than 100
_TREND_DEGREE = 6  # of the polynomial that takes the light's and the lens's falloff
_DEFECT = 8.0  # robust standard deviations from the mean


@dataclass(frozen=True, eq=False)
class Nonuniformity:
    """Spatial variation of a mean image, temporal noise removed: standard deviations."""

    total: float  # of all pixels
    row: float  # of the row means
    column: float  # of the column means
    pixel: float  # of the rest
    sigma: float  # uncertainty of `total` (standard deviation)
    defects: Ints  # (n, 2) row and column of pixels more than 8 sigmas off the median
    pattern: Floats  # (height, width) deviations from the mean


def photo_response_nonuniformity(
    flat: FrameStatistics, stack: FrameStatistics, dark: DarkSignal, mosaic: bool
) -> Nonuniformity:
    """Nonuniformity of the response of a flat field as a share of the mean response.

    The pattern of the dark frames `stack` is subtracted, and with a Bayer mosaic the mean of each
    of its four colors.
    """
    offset = dark.mean_dn(flat.exposure_s) - stack.mean_dn
    signal = flat.mean_image_dn - stack.mean_image_dn - offset
    trend = np.empty_like(signal)
    step = 2 if mosaic else 1
    for row in range(step):
        for column in range(step):
            plane = np.s_[row::step, column::step]
            trend[plane] = _trend(signal[plane])
    response = signal / trend - 1.0
    temporal = flat.variance_dn2 / flat.count + stack.variance_dn2 / stack.count
    return _nonuniformity(response, temporal * float(np.mean(trend**-2)))


def _nonuniformity(deviations: Floats, temporal: float) -> Nonuniformity:
    """Nonuniformity of a mean image's deviations; `temporal` is the variance of its noise."""
    rows, columns = deviations.shape
    measured = float(deviations.var(ddof=1))
    of_rows = float(deviations.mean(axis=1).var(ddof=1)) - temporal / columns
    of_columns = float(deviations.mean(axis=0).var(ddof=1)) - temporal / rows
    total = measured - temporal
    # a mean over a row still has a share of the pixels' variance
    parts = np.linalg.solve(
        [[1.0, 1.0, 1.0], [1.0, 0.0, 1.0 / columns], [0.0, 1.0, 1.0 / rows]],
        [total, of_rows, of_columns],
    )
    row, column, pixel = np.sqrt(np.maximum(parts, 0.0)).tolist()
    spread = float(np.sqrt(max(total, 0.0)))
    variance_sigma = measured * np.sqrt(2.0 / (deviations.size - 1))
    sigma = variance_sigma / (2.0 * spread) if spread > 0.0 else np.sqrt(variance_sigma)
    middle = float(np.median(deviations))
    robust = 1.4826 * float(np.median(np.abs(deviations - middle)))
    is_defect = np.abs(deviations - middle) > _DEFECT * max(robust, np.sqrt(temporal))
    # noise widens the pattern: narrower by as much, it has the spread that was measured
    shrink = np.sqrt(max(total, 0.0) / measured) if measured > 0.0 else 0.0
    pattern = np.where(is_defect, deviations, deviations * shrink)
    return Nonuniformity(spread, row, column, pixel, float(sigma), np.argwhere(is_defect), pattern)


def _trend(signal: Floats) -> Floats:
    """Polynomial of the image coordinates that best fits an image (height, width)."""
    x, y = (
        np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, size), _TREND_DEGREE)
        for size in signal.shape[::-1]
    )
    # on a grid, the best polynomial follows from its parts along rows and columns
    along_x, along_y = np.linalg.qr(x)[0], np.linalg.qr(y)[0]
    coefficients = along_y.T @ signal @ along_x
    orders = np.add.outer(np.arange(_TREND_DEGREE + 1), np.arange(_TREND_DEGREE + 1))
    coefficients[orders > _TREND_DEGREE] = 0.0
    return along_y @ coefficients @ along_x.T
