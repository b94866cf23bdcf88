"""Readout and exposure time, from frames under a flickering lamp or of a turning board."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy  # its submodules load on first use
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares

from omnisim.cameras.camera import CentralCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import MeasurementError
from omnisim.measurement import Quantity, Unobservable
from omnisim.measurement.geometry.boards import BoardView
from omnisim.measurement.geometry.placed_board import BoardSurface, locate_board, pixels_of_points

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
    ratios, frequencies = {}, {}  # power of the strongest frequency over the median power
    for lines, light in both.items():
        power = _powers(_without_scene(light))
        frequencies[lines] = int(np.argmax(power)) / (_FINE * light.shape[1])  # periods per line
        ratios[lines] = float(power.max()) / (float(np.median(power[power > 0.0])) + 1e-30)
    lines = max(ratios, key=lambda axis: ratios[axis])
    light = both[lines]
    if ratios[lines] < MIN_RATIO:
        return _global_shutter(profiles, flicker_hz, name)
    bands = _fit(light, frequencies[lines])
    # reject frames that differ by more than bands and their harmonics, as of a pulsed lamp
    rest = _powers(1.0 + bands.profile - bands.fitted)
    order = np.arange(len(rest)) / (_FINE * bands.profile.shape[1] * bands.frequency)
    harmonic = np.rint(order)
    width = 1.0 / (bands.profile.shape[1] * bands.frequency)  # of a line of the spectrum
    rest[(harmonic >= 2.0) & (np.abs(order - harmonic) <= width)] = 0.0
    share = float(rest.max() / _powers(bands.profile).max())
    if share > MAX_REST:
        raise MeasurementError(
            f"{name}: the frames differ by more than bands: {100.0 * share:.0f} % of the power is "
            "at another frequency: expected a still surface and a still camera"
        )
    count = light.shape[1]
    periods = bands.frequency * (count - 1)
    if periods < MIN_PERIODS:
        raise MeasurementError(
            f"{name}: {periods:.2f} flicker periods per frame: expected at least "
            f"{MIN_PERIODS:g}: use a lamp that flickers faster than {flicker_hz:g} Hz"
        )
    line_s, sigma_s = (value / flicker_hz for value in (bands.frequency, bands.sigma))
    basis = f"{len(light)} frames of {count} {lines}, {periods:.2f} periods of {flicker_hz:g} Hz"
    readout_s = line_s * (count - 1)
    quantities = [
        Quantity("readout_s", readout_s, sigma_s * (count - 1), "s", basis),
        Quantity("line_s", line_s, sigma_s, "s", basis),
        Quantity("modulation", bands.modulation, bands.modulation_sigma, "", basis),
    ]
    reason = "bands look the same in either direction: photograph something that turns"
    unobservable = [Unobservable("readout_direction", reason)]
    exposure = _exposure(bands, lamp_modulation, flicker_hz, basis)
    (quantities if isinstance(exposure, Quantity) else unobservable).append(exposure)  # type: ignore[arg-type]
    return MeasuredTiming(
        readout_s, lines, tuple(quantities), tuple(unobservable), bands.profile, bands.fitted
    )


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
            "expected a flickering lamp, an exposure that is not a multiple of its period, and a "
            "frame rate that is not in step with it"
        )
    basis = f"{len(means)} frames that flicker by {100.0 * flicker:.1f} % as a whole, without bands"
    profile = _without_scene(profiles.rows)
    readout = Quantity("readout_s", 0.0, math.nan, "s", basis)
    reason = f"no bands under {flicker_hz:g} Hz: the shutter is global"
    exposure = Unobservable("exposure_s", reason)
    fitted = np.ones_like(profile)
    return MeasuredTiming(0.0, "rows", (readout,), (exposure,), profile, fitted)


# Readout time of a rolling shutter, from consecutive images of a turning board.
#
# Each row shows the board a little later than the row above it. The board's motion from frame to
# frame gives its velocity, and so the time from row to row from the distortion of its image.
# Unknowns are the pose of the board in the middle of each frame, and the readout time. Between
# frames, the motion is interpolated by a polynomial through the poses of five frames.
#
# Source: Oth, Furgale, Kneip & Siegwart, "Rolling shutter camera calibration" (CVPR 2013), with a
# polynomial through the frames in place of a spline.


MAX_TURN_DEG = 25.0  # between neighboring frames: the interpolation is then right to 1e-3
MAX_SIGMA = 0.02  # of a frame: images with a larger deviation do not determine the readout
MAX_SEEN_FRAMES = 40
_HALF_TURNED_DEG = 150.0  # from one image to the next: a board found from its other end
_WINDOW = 5  # frames of the interpolation
_STEP = 1e-6  # of numerical derivatives: rad, shares of the distance, and frames
_CONVERGED = 1e-9  # relative decrease of the squared errors
_GLOBAL = 4.0  # standard deviations below which the readout time is 0


@dataclass(frozen=True, eq=False)
class MeasuredReadout:
    """Readout of a camera."""

    readout_s: float  # time from the first to the last line; 0: a global shutter
    lines: str  # "rows" or "columns": the lines that are read out one after another
    quantities: tuple[Quantity, ...]  # readout time and line time, with their standard deviations
    unobservable: tuple[Unobservable, ...]  # quantities that the images do not determine
    pixels_px: Floats  # (n, 2) corners of all images
    # errors_px, frozen_px: (n, 2) their errors with the readout, and without it
    errors_px: Floats
    frozen_px: Floats


def measure_readout(
    camera: CentralCamera,
    views: Sequence[BoardView],
    frames: Sequence[int],
    frame_rate_hz: float,
    surface: BoardSurface | None = None,
    name: str = "frames",
) -> MeasuredReadout:
    """Measure the readout time from a board that turns or moves before a camera.

    Args:
        camera: calibrated camera.
        views: the board in each image, at least five; the middle `MAX_SEEN_FRAMES` are used.
        frames, frame_rate_hz: number of the frame of each view, ascending; frames per second.
        surface: shape of the board; None: flat.
        name: name of the images, for messages.

    Raises:
        MeasurementError: too few images, a frame rate that is not positive, a board that turns too
            fast, or hardly at all.
    """
    if not frame_rate_hz > 0.0:
        raise MeasurementError(f"frame rate: expected more than 0 Hz, got {frame_rate_hz:g}")
    if len(views) < MIN_FRAMES:
        raise MeasurementError(
            f"{name}: {len(views)} images with a board: expected at least {MIN_FRAMES}"
        )
    first = max(0, (len(views) - MAX_SEEN_FRAMES) // 2)
    used = slice(first, first + MAX_SEEN_FRAMES)
    views, numbers = views[used], np.array(frames[used], dtype=np.float64)
    surface = BoardSurface.flat() if surface is None else surface
    views, poses = _located(camera, views, surface)
    turns_deg = _turns_deg(poses)
    if turns_deg.max() > MAX_TURN_DEG:
        fastest = views[int(turns_deg.argmax())].name
        raise MeasurementError(
            f"{name}: the board turns by {turns_deg.max():.0f}° from {fastest} to the next image: "
            f"expected at most {MAX_TURN_DEG:g}°: turn it more slowly, and take consecutive frames"
        )
    problem = _Problem(camera, views, numbers, poses, surface)
    frozen = problem.solve()
    axes = {"rows": 1, "columns": 0}
    fits = {lines: problem.solve(axis, frozen.moves) for lines, axis in axes.items()}
    lines = min(fits, key=lambda key: float(np.square(fits[key].errors_px).sum()))
    fit = fits[lines]
    count = camera.height_px if lines == "rows" else camera.width_px
    turn_dps = float(turns_deg.sum() / (numbers[-1] - numbers[0]) * frame_rate_hz)
    if not fit.sigma < MAX_SIGMA:
        raise MeasurementError(
            f"{name}: a board that turns at {turn_dps:.2g}°/s determines the readout only to "
            f"{1e3 * fit.sigma / frame_rate_hz:.2g} ms: turn it faster, about the camera's axis"
        )
    basis = f"{len(fit.errors_px)} corners in {len(views)} images, at {turn_dps:.3g}°/s"
    sigma_s = fit.sigma / frame_rate_hz
    readout_s = abs(fit.readout) / frame_rate_hz
    unobservable = [
        Unobservable("exposure_s", "a board's corners do not show it: use a flickering lamp")
    ]
    if readout_s < _GLOBAL * sigma_s:
        readout_s, lines = 0.0, "rows"
    elif fit.readout < 0.0:
        reason = (
            f"{lines} are read out from the last to the first, which a sensor file cannot "
            "describe: rotate the images by 180°"
        )
        unobservable.append(Unobservable("readout_direction", reason))
    quantities = (
        Quantity("readout_s", readout_s, sigma_s, "s", basis),
        Quantity("line_s", readout_s / (count - 1), sigma_s / (count - 1), "s", basis),
    )
    return MeasuredReadout(
        readout_s, lines, quantities, tuple(unobservable),
        problem.pixels_px, fit.errors_px, frozen.errors_px,
    )  # fmt: skip


def _located(
    camera: CentralCamera, views: Sequence[BoardView], surface: BoardSurface
) -> tuple[list[BoardView], Floats]:
    """Views, and poses (images, 4, 4) of the board in them.

    A chessboard may look the same after half a turn, so that its corners are found from the other
    end: each view is taken the way round that is nearer to the view before.
    """
    used: list[BoardView] = []
    poses: list[Floats] = []
    for view in views:
        pose = locate_board(camera, view, surface).pose
        if poses and _turns_deg(np.stack((poses[-1], pose)))[0] > _HALF_TURNED_DEG:
            turned = BoardView(view.name, view.points_m, view.pixels_px[::-1])
            pose_turned = locate_board(camera, turned, surface).pose
            if _turns_deg(np.stack((poses[-1], pose_turned)))[0] <= MAX_TURN_DEG:
                view, pose = turned, pose_turned
        used.append(view)
        poses.append(pose)
    return used, np.stack(poses)


class _Fit(NamedTuple):
    """Poses and readout with the smallest errors."""

    # (images, 6) rotation vectors, and translations as shares of the board's distance
    moves: Floats
    errors_px: Floats  # (n, 2) measured minus predicted corners
    readout: float  # frames from the first to the last line
    sigma: float  # its standard deviation


class _Problem:
    """Errors of corners by the readout, and by a pose of the board in each frame."""

    def __init__(
        self,
        camera: CentralCamera,
        views: Sequence[BoardView],
        numbers: Floats,
        poses: Floats,
        surface: BoardSurface,
    ) -> None:
        self._camera, self._numbers = camera, numbers
        points = [surface.points(view.points_m) for view in views]
        center = np.concatenate(points).mean(axis=0)  # about which the poses change least
        self._points = np.concatenate(points) - center
        self.pixels_px = np.concatenate([view.pixels_px for view in views])
        self._image = np.repeat(np.arange(len(views)), [len(point) for point in points])
        self._turns = poses[:, :3, :3]
        self._centers = poses[:, :3, :3] @ center + poses[:, :3, 3]
        # indices (images, window) of the images nearest to an image, in time
        count = min(_WINDOW, len(views))
        first = np.clip(np.arange(len(views)) - count // 2, 0, len(views) - count)
        self._windows = first[:, None] + np.arange(count)
        self._length_m = float(np.linalg.norm(self._centers, axis=1).mean())

    def solve(self, axis: int | None = None, moves: Floats | None = None) -> _Fit:
        """Fit the poses, and the readout along an axis of the image, after moves (images, 6).

        An axis of 0: columns are read out one after another; 1: rows; None: all at once.
        """
        images = len(self._numbers)
        vector = np.zeros(6 * images) if moves is None else moves.ravel()
        vector = vector if axis is None else np.append(vector, 0.0)

        def errors(vector: Floats) -> Floats:
            readout = 0.0 if axis is None else float(vector[-1])
            moved = vector[: 6 * images].reshape(-1, 6)
            return self._errors(moved, readout, axis or 0).ravel()

        residuals = errors(vector)
        while True:  # Gauss-Newton: the problem is almost linear
            rates = [
                (errors(vector + step) - residuals) / _STEP for step in _STEP * np.eye(len(vector))
            ]
            jacobian = np.stack(rates, axis=1)
            trial = vector - np.linalg.lstsq(jacobian, residuals, rcond=None)[0]
            after = errors(trial)
            gain = float(residuals @ residuals - after @ after)
            if gain <= 0.0:
                break
            vector, residuals = trial, after
            if gain < _CONVERGED * float(after @ after):
                break
        fitted = vector[: 6 * images].reshape(-1, 6), residuals.reshape(-1, 2)
        if axis is None:
            return _Fit(*fitted, 0.0, 0.0)
        variance = float(residuals @ residuals) / max(len(residuals) - len(vector), 1)
        sizes = np.linalg.norm(jacobian, axis=0)
        inverse = np.linalg.pinv((jacobian / sizes).T @ (jacobian / sizes), hermitian=True)
        sigma = math.sqrt(variance * float(inverse[-1, -1])) / float(sizes[-1])
        return _Fit(*fitted, float(vector[-1]), sigma)

    def _errors(self, moves: Floats, readout: float, axis: int) -> Floats:
        """Errors (n, 2) after moves (images, 6) of the poses, for a readout in frames."""
        turns = scipy.spatial.transform.Rotation.from_rotvec(moves[:, :3]).as_matrix() @ self._turns
        centers = self._centers + self._length_m * moves[:, 3:]
        count = self._camera.height_px if axis == 1 else self._camera.width_px
        times = readout * (self.pixels_px[:, axis] / (count - 1.0) - 0.5)
        windows = self._windows[self._image]  # (n, window)
        weights = _lagrange(self._numbers[windows] - self._numbers[self._image, None], times)
        own = turns[self._image]
        relative = np.einsum("iba,iwbc->iwac", turns, turns[self._windows]).reshape(-1, 3, 3)
        steps = scipy.spatial.transform.Rotation.from_matrix(relative).as_rotvec()
        steps = steps.reshape(*self._windows.shape, 3)
        vectors = np.einsum("nw,nwj->nj", weights, steps[self._image])
        turned = scipy.spatial.transform.Rotation.from_rotvec(vectors).apply(self._points)
        points = np.einsum("nij,nj->ni", own, turned)
        points += np.einsum("nw,nwj->nj", weights, centers[windows])
        seen = pixels_of_points(self._camera, points)
        return np.where(seen.valid[:, None], self.pixels_px - seen.positions_px, 100.0)


def _lagrange(nodes: Floats, times: Floats) -> Floats:
    """Weights (n, window) of the values at nodes (n, window) for values at times (n,)."""
    count = nodes.shape[1]
    weights = np.ones_like(nodes)
    for own in range(count):
        for other in range(count):
            if other != own:
                weights[:, own] *= (times - nodes[:, other]) / (nodes[:, own] - nodes[:, other])
    return weights


def _turns_deg(poses: Floats) -> Floats:
    """Angles (images - 1,) between the boards of neighboring images, degrees."""
    relative = poses[:-1, :3, :3].swapaxes(1, 2) @ poses[1:, :3, :3]
    vectors = scipy.spatial.transform.Rotation.from_matrix(relative).as_rotvec()
    return np.degrees(np.linalg.norm(vectors, axis=1))
