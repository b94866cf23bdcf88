"""Effect of each degradation alone on pixels, landmarks and self-localization.

The recorded clean images are degraded in NumPy, one degradation at a time, with increasing
strength; nothing is rendered again. Defocus and noise are faster versions of those in
`omnisim.rendering.camera.degradations`. Motion blur is that of a turn on the spot, which rotates
the image about its middle: straight motion blurs less.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import ndimage
from scipy.signal import fftconvolve

from omnisim.core.arrays import Bools, Bytes, Floats32
from omnisim.core.srgb import linear_from_srgb8, srgb8_from_linear
from omnisim.core.trajectories.odometry import OdometryErrors
from omnisim.perception.landmarks.color_model import ColorModel
from omnisim.perception.landmarks.landmark_detector import LandmarkDetector
from omnisim.perception.localization.filter import FilterParameters, LandmarkMap
from omnisim.rendering.camera.degradations import Jpeg, Vignetting, WhiteBalance
from omnisim.rendering.camera.degradations.defocus import covered_share
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.runs.run_data import RunData
from omnisim.validation.experiments.detection_accuracy import accuracy, compare
from omnisim.validation.experiments.experiment_runs import observations_from_detections, run_seeds
from omnisim.validation.experiments.recordings import Progress

NEAR_M = 4.0
SEEDS = 5  # of the odometry noise, at each level
READ_NOISE_E = 5.0
_SRGB = srgb8_from_linear(np.linspace(0.0, 1.0, 4096))
Light = Floats32  # (height, width, 4) linear; the fourth is 1 where the scene is visible


@dataclass(frozen=True)
class Cause:
    """Degradation in the sweep."""

    name: str  # name in the report
    unit: str  # unit of the levels
    levels: tuple[float, ...]  # levels in increasing strength
    # function that degrades light at a level and step
    apply: Callable[[Light, ImageGeometry, float, int], Light]


@dataclass(frozen=True)
class Outcome:
    """Results at one level of a degradation."""

    # rates for landmarks within `NEAR_M`
    recall: float
    precision: float
    bearing_rms_rad: float  # RMS bearing error of true positives
    range_rms_share: float  # RMS range error of true positives, as a share of the range
    false_alarms: float  # share of pixels without a landmark that are taken for a landmark's color
    error_m: float  # median over seeds of the mean position error


def _defocus(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """Mean of visible pixels over a disc of `level` px radius, as `Defocus`, by FFT."""
    reach = math.ceil(level)
    span = range(-reach, reach + 1)
    radius = np.array(level, dtype=np.float32)
    disc = np.array([[covered_share(right, down, radius) for right in span] for down in span])
    disc = (disc / disc.sum()).astype(np.float32)[..., None]
    share = light[..., 3:]
    blurred = fftconvolve(light[..., :3] * share, disc, mode="same", axes=(0, 1))
    weight = fftconvolve(share, disc, mode="same", axes=(0, 1))
    result = light.copy()
    result[..., :3] = blurred / np.maximum(weight, np.float32(1e-3))
    return result


def _motion_blur(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """Mean over a rotation by `level` degrees about the middle of the image."""
    count = 2 + math.ceil(level)
    total = np.zeros_like(light)
    u0, v0 = geometry.center_px
    for angle in np.radians(level) * (np.arange(count) / (count - 1) - 0.5):
        cosine, sine = math.cos(angle), math.sin(angle)
        matrix = np.array([[cosine, -sine], [sine, cosine]])  # of (row, column)
        offset = np.array([v0, u0]) - matrix @ (v0, u0)
        for channel in range(4):
            total[..., channel] += ndimage.affine_transform(
                light[..., channel], matrix, offset, order=1, mode="nearest", output=np.float32
            )
    return total / np.float32(count)


def _noise(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """Gaussian shot and read noise with the variances of `Noise`, for a full well of `level`."""
    generator = np.random.default_rng([2, step])
    colors = np.maximum(light[..., :3], np.float32(0.0))
    sigma = np.sqrt(colors * np.float32(level) + np.float32(READ_NOISE_E**2)) / np.float32(level)
    noisy = light.copy()
    noisy[..., :3] += sigma * generator.standard_normal(colors.shape, dtype=np.float32)
    return noisy


def _vignetting(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    return Vignetting(coefficients=(-level, 0.0, 0.0)).apply(light, geometry)


def _darkness(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """Changing light: a wave of `level` stops over 24 steps."""
    ev = -0.5 * level * (1.0 - math.cos(2.0 * math.pi * step / 24.0))
    dimmed = light.copy()
    dimmed[..., :3] *= np.float32(2.0**ev)
    return dimmed


def _white_balance(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """White balance that is too warm: red is multiplied, and blue divided, by 1 + `level`."""
    gains = (1.0 + level, 1.0, 1.0 / (1.0 + level))
    return WhiteBalance(response=(1.0, 1.0, 1.0), gains=gains).apply(light, geometry)


CAUSES = (
    Cause("defocus", "px radius", (1.0, 2.0, 4.0), _defocus),
    Cause("motion blur", "° of a turn", (1.0, 3.0, 8.0), _motion_blur),
    Cause("noise", "electrons full well", (4000.0, 600.0, 100.0), _noise),
    Cause("vignetting", "light lost at the rim", (0.2, 0.45, 0.7), _vignetting),
    Cause("changing light", "stops", (0.5, 1.0, 2.0), _darkness),
    Cause("white balance", "red gain", (0.05, 0.12, 0.25), _white_balance),
    Cause("JPEG", "quality", (80.0, 40.0, 12.0), lambda light, *_: light),
)


def sweep(
    run: RunData,
    labels: Callable[[int], Bytes],
    model: ColorModel,
    wheels: OdometryErrors,
    parameters: FilterParameters,
    progress: Progress,
) -> tuple[Outcome, Mapping[str, list[Outcome]]]:
    """Outcome without degradation; and for each cause, by name, the outcomes of its levels."""
    detector = LandmarkDetector(model, run.landmarks, run.mount)
    geometry = ImageGeometry.of_camera(run.mount.camera)
    images = list(run.images())
    truth = [labels(step) for step in range(run.steps)]
    covered = run.mount.covered
    shown = np.ones(images[0].shape[:2], bool) if covered is None else covered

    def evaluate(change: Callable[[Bytes, int], Bytes]) -> Outcome:
        detections, alarms, others = [], 0, 0
        for step, image in enumerate(images):
            changed = change(image, step)
            detections.append(detector(changed))
            if step % 6 == 0:
                neg = shown & (truth[step] == 0)
                alarms += int(np.count_nonzero(model.classify(changed[neg])))
                others += int(np.count_nonzero(neg))
        poses = run.true_poses
        assert poses is not None
        landmarks = LandmarkMap.of_scene(run.landmarks)
        near = accuracy(compare(detections, poses, landmarks, run.mount.position_m), 0.0, NEAR_M)
        seen = observations_from_detections(detections, parameters)
        seeds = run_seeds(run, wheels, [seen] * SEEDS, parameters)
        error_m = float(np.median(seeds.errors_m[:, 5:].mean(axis=1)))
        rms = near.bearing_rms_rad, near.range_rms_share
        return Outcome(near.recall, near.precision, *rms, alarms / max(others, 1), error_m)

    tasks = [(cause, level) for cause in CAUSES for level in cause.levels]
    outcomes: dict[str, list[Outcome]] = {cause.name: [] for cause in CAUSES}
    for index in progress("degradations, one by one", len(tasks))(range(len(tasks))):
        cause, level = tasks[index]
        change = partial(degraded, shown=shown, geometry=geometry, cause=cause, level=level)
        outcomes[cause.name].append(evaluate(change))
    return evaluate(lambda image, _: image), outcomes


def degraded(
    image: Bytes, step: int, shown: Bools, geometry: ImageGeometry, cause: Cause, level: float
) -> Bytes:
    """Image (height, width, 3), sRGB, with one degradation."""
    light = np.concatenate((linear_from_srgb8(image), shown[..., None].astype(np.float32)), axis=-1)
    light = cause.apply(light, geometry, level, step)
    steps = np.rint(np.clip(light[..., :3], 0.0, 1.0) * np.float32(len(_SRGB) - 1))
    rgba = np.concatenate((_SRGB[steps.astype(np.int32)], shown[..., None] * np.uint8(255)), axis=2)
    rgba[~shown] = 0
    if cause.name == "JPEG":
        rgba = Jpeg(quality=int(level), subsampling="4:2:0").compressed(rgba)
    return np.ascontiguousarray(rgba[..., :3])
