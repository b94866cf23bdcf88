"""Noise, response, vignetting and readout, measured from synthetic frames."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from omnisim.cameras import KannalaBrandtCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import MeasurementError
from omnisim.core.poses import rotation_from_roll_pitch_yaw
from omnisim.core.srgb import srgb_from_linear
from omnisim.measurement.geometry import BoardView, Chessboard
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.measurement.noise import FrameStatistics, frame_statistics, measure_noise
from omnisim.measurement.response import measure_response, measure_vignetting
from omnisim.measurement.timing import line_profiles, measure_readout, measure_timing
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.report.report import Measure, ResultTable, Section
from omnisim.validation.fixture import Fixture

CAMERAS, QUICK_CAMERAS = 12, 4
TURNING, QUICK_TURNING = 4, 1  # cameras before a turning board
TIMES_S = (1e-3, 2e-3, 4e-3, 8e-3, 16e-3, 32e-3)
SIZE, FRAMES, FLICKER_HZ, FRAME_S = (320, 240), 10, 100.0, 0.0337
MAX_TANGENT2 = 0.95  # squared tangent at half the shorter side: 117° from corner to corner
RESPONSE_BOUND, VIGNETTING_BOUND, READOUT_BOUND = 0.01, 0.005, 0.01
_LIGHT = np.linspace(0.03, 0.97, 95)
CAMERA = KannalaBrandtCamera(320, 240, (160.0, 160.4), (161.0, 118.5), (0.012, -8e-3, 2e-3, -5e-4))
BOARD = Chessboard(7, 6, 0.03)
BOARD_FRAMES, FRAME_RATE_HZ = 10, 30.0
_DISTANCE_M, _TILT_RAD = 0.25, (0.25, -0.15)
_SAMPLES = 3  # of a pixel's side
_BLACK, _WHITE, _BACKGROUND = 30.0, 220.0, 110.0


def check_response(fixture: Fixture, title: str) -> Section:
    """Measure random cameras from their frames, and compare with their formulas."""
    count = QUICK_CAMERAS if fixture.is_quick else CAMERAS
    rows, errors = [], []
    for seed in range(count):
        random = np.random.default_rng(seed)
        name, encode = _response(seed, random)
        of_camera = response_error(encode, random), vignetting_error(random), readout_error(random)
        errors.append(of_camera)
        rows.append((name, *(f"{100.0 * error:.3f} %" for error in of_camera)))
    boards = QUICK_TURNING if fixture.is_quick else TURNING
    turning = max(turning_readout_error(np.random.default_rng(seed)) for seed in range(boards))
    response, vignetting, readout = np.max(errors, axis=0).tolist()
    columns = ("transfer function", "response", "vignetting", "readout")
    return Section(
        title,
        f"Values measured by `omnisim.measurement` from the frames of {count} random cameras. The "
        f"frames are a static 8-bit scene at {len(TIMES_S)} exposure times, with noise of 0.5 % of "
        "white; a flat field in light with a gradient, through a lens of up to 117° across the "
        "diagonal with cos⁴ vignetting; and "
        f"{FRAMES} frames under a lamp of {FLICKER_HZ:g} Hz, with noise of 2 of 255, in which each "
        "row is the mean of the lamp's light over its exposure; and "
        f"for {boards} cameras, {BOARD_FRAMES} frames of an unevenly turning chessboard, with the "
        "same noise, in which each row shows the board at its own time.",
        (
            Measure("transfer function, largest error of full scale", 100.0 * response, "%",
                    100.0 * RESPONSE_BOUND),
            Measure("vignetting over the field, largest error", 100.0 * vignetting, "%",
                    100.0 * VIGNETTING_BOUND),
            Measure("readout time by a lamp, largest error", 100.0 * readout, "%",
                    100.0 * READOUT_BOUND),
            Measure("readout time by a turning board, largest error", 100.0 * turning, "%",
                    100.0 * READOUT_BOUND),
        ),
        (ResultTable("Largest errors of each camera", columns, tuple(rows)),),
    )  # fmt: skip


def _response(seed: int, random: np.random.Generator) -> tuple[str, Callable[[Floats], Floats]]:
    """Name of a transfer function, and the function of light in [0, 1]."""
    if seed % 4 == 0:
        return "sRGB", lambda light: np.asarray(srgb_from_linear(light), dtype=np.float64)
    if seed % 4 == 1:
        gamma = random.uniform(1.5, 2.4)
        return f"light^(1/{gamma:.3f})", lambda light: light ** (1.0 / gamma)
    if seed % 4 == 2:
        return "linear", lambda light: light
    half = random.uniform(0.25, 0.5)
    name = f"light/(light + {half:.3f}), to 1"
    return name, lambda light: (1.0 + half) * light / (light + half)


def response_error(encode: Callable[[Floats], Floats], random: np.random.Generator) -> float:
    """Largest error of the measured transfer function, as a share of full scale.

    The light of white is unknown; it is chosen so that both functions agree at one half.
    """
    scene = np.exp(random.uniform(math.log(0.5), math.log(300.0), (60, 80)))  # light per second
    images = []
    for time_s in TIMES_S:
        levels = encode(np.clip(scene * time_s, 0.0, 1.0)) + 0.005 * random.normal(size=scene.shape)
        images.append(np.rint(np.clip(levels, 0.0, 1.0) * 255.0).astype(np.uint8))
    encoding = measure_response(images, TIMES_S).encoding
    true = encode(_LIGHT)
    scale = np.interp(0.5, true, _LIGHT) / float(encoding.linearized(np.array(0.5)))
    errors = encoding.encoded(_LIGHT / scale) - true
    return float(np.abs(errors[true < 0.97]).max())


def vignetting_error(random: np.random.Generator) -> float:
    """Largest error of the measured vignetting, as a share of the light at the center."""
    center = 160.0 + random.uniform(-5.0, 5.0), 120.0 + random.uniform(-5.0, 5.0)
    squared = ImageGeometry(*SIZE, center).squared_radii().astype(np.float64)
    true = 1.0 / (1.0 + random.uniform(0.1, MAX_TANGENT2) * squared) ** 2
    v, u = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float64)
    slopes = random.uniform(-0.1, 0.1, 2)
    lamp = 1.0 + slopes[0] * (u - center[0]) / SIZE[0] + slopes[1] * (v - center[1]) / SIZE[1]
    flat = 0.7 * true * lamp + 0.005 * random.normal(size=true.shape)
    coefficients = measure_vignetting(flat, center).vignetting.coefficients
    drawn = np.polynomial.polynomial.polyval(squared, (1.0, *coefficients))
    return float(np.abs(drawn - true).max())


def readout_error(random: np.random.Generator) -> float:
    """Relative error of the measured readout time."""
    readout_s, exposure_s = random.uniform(0.009, 0.03), random.uniform(0.001, 0.004)
    scene = 90.0 + 40.0 * random.random(SIZE[::-1])
    rate = 2.0 * math.pi * FLICKER_HZ
    starts = readout_s * np.arange(SIZE[1]) / (SIZE[1] - 1)
    frames = []
    for number in range(FRAMES):
        first = number * FRAME_S + starts
        swing = np.sin(rate * (first + exposure_s)) - np.sin(rate * first)
        lit = scene * (1.0 + 0.4 * swing / (rate * exposure_s))[:, None]
        lit += 2.0 * random.normal(size=lit.shape)
        frames.append(np.rint(np.clip(lit, 0.0, 255.0)).astype(np.uint8))
    return abs(measure_timing(line_profiles(frames, 255.0), FLICKER_HZ).readout_s / readout_s - 1.0)


def turning_readout_error(random: np.random.Generator) -> float:
    """Relative error of the readout time measured from ten frames of an unevenly turning board."""
    readout_s, turn_radps = random.uniform(0.012, 0.03), np.radians(random.uniform(300.0, 500.0))
    views, numbers = list[BoardView](), list[int]()
    for number in range(BOARD_FRAMES):
        image = _image(number / FRAME_RATE_HZ, readout_s, turn_radps)
        noisy = np.rint(np.clip(image + 2.0 * random.normal(size=image.shape), 0.0, 255.0))
        with suppress(MeasurementError):  # the board is not detected in every image
            views.append(find_board(noisy.astype(np.uint8), BOARD, f"frame {number}"))
            numbers.append(number)
    measured = measure_readout(CAMERA, views, numbers, FRAME_RATE_HZ)
    return abs(measured.readout_s / readout_s - 1.0)


def _image(time_s: float, readout_s: float, turn_radps: float) -> Floats:
    """Gray levels (height, width) of a frame; `time_s` is the time of its middle row."""
    v, u = np.mgrid[: CAMERA.height_px, : CAMERA.width_px].astype(np.float64)
    times_s = time_s + readout_s * (np.arange(CAMERA.height_px) / (CAMERA.height_px - 1.0) - 0.5)
    angles = turn_radps * times_s + 0.1 * np.sin(9.0 * times_s)  # a hand does not turn evenly
    tilt = rotation_from_roll_pitch_yaw(*_TILT_RAD, 0.0)
    turns = np.stack([tilt @ rotation_from_roll_pitch_yaw(0.0, 0.0, angle) for angle in angles])
    middle = 0.5 * BOARD.square_m * np.array([BOARD.columns - 1.0, BOARD.rows - 1.0, 0.0])
    levels = np.zeros(v.shape)
    offsets = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    for dv in offsets:
        for du in offsets:
            rays = CAMERA.ray_from_pixel(np.stack((u + du, v + dv), axis=-1)).directions
            # the board's plane passes through (0, 0, distance), with the tilted normal
            scale = _DISTANCE_M * tilt[2, 2] / (rays @ tilt[:, 2])
            points = rays * scale[..., None] - (0.0, 0.0, _DISTANCE_M)
            points = np.einsum("vuj,vjk->vuk", points, turns) + middle
            column, row = np.moveaxis(np.floor(points[..., :2] / BOARD.square_m).astype(int), -1, 0)
            in_row, in_column = row + 1 <= BOARD.rows, column + 1 <= BOARD.columns
            is_square = (column >= -1) & in_column & (row >= -1) & in_row
            is_paper = (
                (column >= -2) & (column <= BOARD.columns) & (row >= -2) & (row <= BOARD.rows)
            )
            is_black = is_square & ((column + row) % 2 == 0)
            levels += np.where(is_black, _BLACK, np.where(is_paper, _WHITE, _BACKGROUND))
    return levels / _SAMPLES**2


# Noise, measured from frames simulated by the reference implementation of EMVA 1288.


NOISY_CAMERAS, QUICK_NOISY_CAMERAS = 20, 1


def check_noise(fixture: Fixture, title: str) -> Section:
    """Measure the noise of random cameras; compare it with their true parameters."""
    count = QUICK_NOISY_CAMERAS if fixture.is_quick else NOISY_CAMERAS
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


# Reference implementation of EMVA 1288: its simulated cameras.


BIT_DEPTHS = (8, 10, 12, 14)
LEVELS, STACK = 16, 7  # exposures, and the number of the one with many frames
STACK_FRAMES = 50
_OFFSETS_PER_SIGMA = 6.0  # of its dark signal above 0, at which it clips
# Bounds of the measurement, as shares of the true value.
BOUNDS = {
    "gain_e_per_dn": 0.01,
    "read_noise_e": 0.03,
    "full_well_e": 0.03,
    "dsnu_e": 0.05,
    "prnu": 0.05,
    "dark_current_e_per_s": 0.05,
}


@dataclass(frozen=True, eq=False)
class ReferenceCamera:
    """Camera of the reference implementation's simulator, with known noise."""

    camera: Any  # `Camera` of the reference implementation
    bit_depth: int  # bits of the converter
    exposure_s: float  # exposure time at which `radiance` saturates the camera
    radiance: Any  # light of the flat fields, in the simulator's units
    true: dict[str, float]  # true values by key of the sensor file

    @classmethod
    def drawn(cls, seed: int, size: tuple[int, int] = (640, 480)) -> ReferenceCamera:
        """Camera with random parameters in the range of real cameras."""
        from emva1288.camera.camera import Camera

        rng = np.random.default_rng(seed)
        width, height = size
        bits = int(rng.choice(BIT_DEPTHS))
        well_e = float(rng.uniform(5e3, 4e4))
        gain = (2**bits - 1) * float(rng.uniform(0.7, 1.3)) / well_e  # DN per electron
        read_e = max(float(rng.uniform(3.0, 20.0)), 0.8 / gain)  # above quantization
        prnu, dsnu_e = float(rng.uniform(0.004, 0.02)), float(rng.uniform(0.7, 8.0))
        current_e_per_s = float(rng.uniform(30.0, 3000.0))
        offset_e = 10.0 + _OFFSETS_PER_SIGMA * (read_e + dsnu_e)
        exposure_s = float(rng.choice((0.02, 0.05)))
        camera = Camera(
            bit_depth=bits, width=width, height=height, seed=seed,
            K=gain, K_min=gain, K_max=gain, K_steps=1, blackoffset=0, u_esat=well_e,
            dark_signal_0=offset_e, sigma2_dark_0=read_e**2, dark_current_ref=current_e_per_s,
            temperature=30.0, temperature_ref=30.0, exposure=1e9 * exposure_s,
            dsnu=rng.normal(0.0, dsnu_e, (height, width)),
            prnu=1.0 + rng.normal(0.0, prnu, (height, width)),
        )  # fmt: skip
        full_e = min(well_e, (2**bits - 1) / gain)
        true = {
            "gain_e_per_dn": 1.0 / gain,
            # it quantizes twice, once by a uniform random number
            "read_noise_e": float(np.sqrt(read_e**2 + 1.0 / 12.0 / gain**2)),
            "full_well_e": full_e - offset_e,
            "dsnu_e": dsnu_e,
            "prnu": prnu,
            "dark_current_e_per_s": current_e_per_s,
        }
        radiance = camera.get_radiance_for(mean=full_e * gain)
        return cls(camera, bits, exposure_s, radiance, true)

    def dark_and_flat(self) -> tuple[list[FrameStatistics], list[FrameStatistics]]:
        """Statistics of dark frames and flat fields: two per exposure, 50 at one exposure."""
        darks: list[FrameStatistics] = []
        flats: list[FrameStatistics] = []
        for number, share in enumerate(np.linspace(0.03, 1.15, LEVELS)):
            time_s = float(share * self.exposure_s)
            self.camera.exposure = 1e9 * time_s
            count = STACK_FRAMES if number == STACK else 2
            for group, light in ((darks, 0), (flats, self.radiance)):
                frames = (self.camera.grab(light) for _ in range(count))
                group.append(frame_statistics(frames, time_s, f"{1e3 * time_s:.3g}ms"))
        return darks, flats

    def truth(self) -> dict[str, tuple[float, float]]:
        """True values with the relative bounds of their measurement."""
        return {name: (value, BOUNDS[name]) for name, value in self.true.items()}
