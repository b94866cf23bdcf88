"""Noise parameters of a camera, from statistics of dark frames and flat fields.

Source: EMVA Standard 1288, release 4.0, for names, definitions and the linear model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.measurement.noise.frame_statistics import FrameStatistics
from omnisim.measurement.noise.photon_transfer import (
    MIN_FRAMES,
    DarkSignal,
    Nonuniformity,
    PhotonTransfer,
    dark_nonuniformity,
    dark_signal,
    photo_response_nonuniformity,
    photon_transfer,
)
from omnisim.measurement.quantity import Quantity, Unobservable
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
    """Noise of a camera.

    Attributes:
        noise: noise parameters for the sensor file, without the pattern.
        quantities: measured quantities with their standard deviations.
        unobservable: quantities that the frames do not determine.
        curve: photon transfer curve.
        pattern: (height, width, 2) float32: deviation of each pixel's gain as a share, and of its
            dark signal in electrons; None: too few frames.
        defects: (n, 2) row and column of defective pixels.
        exposure_s: exposure time of the frames used to measure the pattern.
    """

    noise: Noise
    quantities: tuple[Quantity, ...]
    unobservable: tuple[Unobservable, ...]
    curve: PhotonTransfer
    pattern: NDArray[np.float32] | None
    defects: NDArray[np.int64]
    exposure_s: float


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
    for one in darks:
        _check_dark(one, largest_dn)
    dark = dark_signal(darks)
    curve = photon_transfer(flats, dark)
    result = _Collector(curve, dark, largest_dn, mosaic)
    result.gain()
    result.dark()
    result.saturation()
    stack, flat = max(darks, key=lambda one: one.count), _flat_stack(flats, dark, curve)
    result.pattern(stack, flat)
    return MeasuredNoise(
        noise=Noise(bit_depth=bits, **result.parameters),
        quantities=tuple(result.quantities),
        unobservable=tuple(result.unobservable),
        curve=curve,
        pattern=result.map,
        defects=result.defects,
        exposure_s=(flat or stack).exposure_s,
    )


def _aligned(
    darks: Sequence[FrameStatistics], flats: Sequence[FrameStatistics], bit_depth: int | None
) -> tuple[list[FrameStatistics], list[FrameStatistics], int]:
    """Statistics in units of the converter's steps, and the converter's number of bits."""
    everything = [*darks, *flats]
    first = everything[0]
    bits = 0
    for one in everything:
        bits |= one.bits
        if one.mean_image_dn.shape != first.mean_image_dn.shape:
            height, width = one.mean_image_dn.shape
            expected = f"{first.mean_image_dn.shape[1]} × {first.mean_image_dn.shape[0]} px"
            raise MeasurementError(
                f"{one.name}: expected {expected} as in {first.name}, got {width} × {height} px"
            )
    if bits == 0:
        raise MeasurementError(f"{first.name} and others: expected light in the flats, got zeros")
    shift = (bits & -bits).bit_length() - 1  # values at the upper end of 16 bits
    used = (bits >> shift).bit_length()
    if bit_depth is not None and used > bit_depth:
        raise MeasurementError(f"bit depth {bit_depth}: expected at least {used}, which values use")
    return (
        [one.shifted(shift) for one in darks],
        [one.shifted(shift) for one in flats],
        bit_depth or used,
    )


def _check_dark(dark: FrameStatistics, largest_dn: float) -> None:
    if dark.zeros > MAX_ZEROS:
        raise MeasurementError(
            f"{dark.name}: expected at most {100 * MAX_ZEROS:g} % of the dark values at 0, got "
            f"{100 * dark.zeros:.2g} %: raise the camera's black level"
        )
    blocks = _block_means(dark.mean_image_dn)
    leak = float(np.ptp(blocks))
    pixels = dark.mean_image_dn.size / blocks.size
    noise = float(np.std(dark.mean_image_dn)) / math.sqrt(pixels)
    if leak > MAX_LEAK * largest_dn + _LEAK_SIGMAS * noise:
        row, column = np.unravel_index(int(np.argmax(blocks)), blocks.shape)
        vertical = "upper" if row < len(blocks) / 2 else "lower"
        horizontal = "left" if column < blocks.shape[1] / 2 else "right"
        side = f"{vertical} {horizontal}"
        raise MeasurementError(
            f"{dark.name}: expected even dark frames, got {leak:.3g} DN more at the {side}: light "
            "leaks in, cover the lens"
        )


def _block_means(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means of 8 × 8 equal blocks of an image; of fewer if it has fewer rows or columns."""
    rows, columns = (min(_LEAK_BLOCKS, size) for size in image.shape)
    return np.array(
        [
            [part.mean() for part in np.array_split(strip, columns, axis=1)]
            for strip in np.array_split(image, rows, axis=0)
        ]
    )


def _flat_stack(
    flats: Sequence[FrameStatistics], dark: DarkSignal, curve: PhotonTransfer
) -> FrameStatistics | None:
    """Flat field with enough frames nearest to 50 % of saturation; None: too few frames in all."""
    brightest = max(one.mean_dn for one in flats)
    end_dn = brightest if curve.saturation_dn is None else curve.saturation_dn
    stacks = [one for one in flats if one.count >= MIN_FRAMES and one.mean_dn < 0.9 * end_dn]
    middle_dn = 0.5 * (dark.black_dn + end_dn)
    return min(stacks, key=lambda one: abs(one.mean_dn - middle_dn), default=None)


class _Collector:
    """Parameters, quantities and unobservable quantities, in the order of their measurement."""

    def __init__(self, curve: PhotonTransfer, dark: DarkSignal, largest_dn: float, mosaic: bool):
        self._curve, self._dark, self._largest_dn, self._mosaic = curve, dark, largest_dn, mosaic
        self._gain = 1.0 / curve.gain_dn_per_e
        self._gain_share = curve.gain_sigma_dn_per_e / curve.gain_dn_per_e
        self.parameters: dict[str, Any] = {}
        self.quantities: list[Quantity] = []
        self.unobservable: list[Unobservable] = []
        self.map: NDArray[np.float32] | None = None
        self.defects = np.zeros((0, 2), dtype=np.int64)

    def gain(self) -> None:
        """Measure the gain of the converter."""
        levels = int(self._curve.used.sum())
        self._add(
            "gain_e_per_dn", self._gain, self._gain * self._gain_share, "e/DN",
            f"slope of the temporal variance over {levels} flat levels",
        )  # fmt: skip

    def dark(self) -> None:
        """Measure black level, dark current and read noise."""
        dark, gain = self._dark, self._gain
        count = sum(one.count for one in dark.frames)
        black = dark.black_dn
        exposures = len(dark.frames)
        frames = f"{count} dark frames at {exposures} exposure{'s' if exposures > 1 else ''}"
        rate_e, rate_sigma = gain * dark.rate_dn_per_s, gain * dark.rate_sigma_dn_per_s
        if not math.isfinite(rate_sigma):
            self.unobservable.append(
                Unobservable("dark_current_e_per_s", "take dark frames at two exposures or more")
            )
        elif rate_e < _SIGNIFICANT * rate_sigma:
            limit = f"below {max(rate_e, 0.0) + 2.0 * rate_sigma:.3g} e/s"
            self.unobservable.append(
                Unobservable(
                    "dark_current_e_per_s", f"{limit}: take dark frames at longer exposures"
                )
            )
        else:
            sigma = math.hypot(rate_sigma, rate_e * self._gain_share)
            self._add("dark_current_e_per_s", rate_e, sigma, "e/s", f"growth over {frames}")
        self._add("black_level_dn", black, dark.black_sigma_dn, "DN", f"mean of {frames}")
        variances = np.array([one.variance_dn2 for one in dark.frames])
        sigmas = np.array([one.variance_sigma_dn2 for one in dark.frames])
        # electrons of the dark current have shot noise of their own
        growth = np.array([dark.rate_dn_per_s * one.exposure_s for one in dark.frames])
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
            self.unobservable.append(Unobservable("read_noise_e", reason))
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
            self.unobservable.append(
                Unobservable(
                    "full_well_e",
                    f"above {self._gain * brightest:.4g} e: take a flat that saturates all pixels",
                )
            )
            white_dn = self._largest_dn - self._dark.black_dn
            self.parameters["full_well_e"] = self._gain * white_dn
            return
        well_e = self._gain * (end_dn - self._dark.black_dn)
        at_end = end_dn > self._largest_dn - 1.0
        by = "the converter's largest number" if at_end else "the pixels' wells"
        basis = f"saturation at {end_dn:.0f} DN, {by}"
        self._add("full_well_e", well_e, well_e * self._gain_share, "e", basis)

    def pattern(self, dark: FrameStatistics, flat: FrameStatistics | None) -> None:
        """Measure both nonuniformities and the map of deviations, and find defective pixels."""
        few = f"take {MIN_FRAMES} frames or more"
        if dark.count < MIN_FRAMES:
            self.unobservable += [
                Unobservable("dsnu_e", f"{few} in the dark"),
                Unobservable("prnu", few),
            ]
            return
        dsnu = dark_nonuniformity(dark)
        gain = self._gain
        self._add_parts("dsnu_e", dsnu, gain, "e", f"{dark.count} dark frames")
        if flat is None:
            self.unobservable.append(
                Unobservable("prnu", f"{few} of a flat near 50 % of saturation")
            )
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
        sigma = factor * math.hypot(
            spread.sigma, spread.total * self._gain_share if factor != 1.0 else 0.0
        )
        if spread.total < _SIGNIFICANT * spread.sigma:
            limit = factor * (spread.total + 2.0 * spread.sigma)
            self.unobservable.append(
                Unobservable(name, f"below {limit:.2g} {unit}: take more frames")
            )
            return
        self._add(name, factor * spread.total, sigma, unit, basis)
        stem, ending = (name[:-2], "_e") if name.endswith("_e") else (name, "")
        for part in ("row", "column", "pixel"):
            value = factor * getattr(spread, part)
            quantity = Quantity(f"{stem}_{part}{ending}", value, math.nan, unit, basis)
            self.quantities.append(quantity)

    def _add(self, name: str, value: float, sigma: float, unit: str, basis: str) -> None:
        self.parameters[name] = value
        self.quantities.append(Quantity(name, value, sigma, unit, basis))
