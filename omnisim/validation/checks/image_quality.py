"""Image quality: comparison with 256 samples per pixel, and shimmer in a slow pan."""

from __future__ import annotations

import dataclasses

import numpy as np

from omnisim.cameras import pixel_grid
from omnisim.core import bilinear
from omnisim.core.arrays import Bools, Floats
from omnisim.core.cube import FACE_NAMES, face_index, face_tangents
from omnisim.core.srgb import linear_from_srgb, srgb8_from_linear, srgb_from_linear
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.scene import Scene
from omnisim.validation.fixture import Fixture, linear_image, mirror_camera
from omnisim.validation.image_differences import psnr_db

SIZE_PX = 360
# Plain bilinear, as other simulators sample a cube: faces of this size, one lookup per pixel.
PLAIN_FACE_PX = 512
SAMPLES_PER_SIDE = 8  # samples per pixel side; four shifted images make 256 samples
SHIFTS = ((-0.25, -0.25), (0.25, 0.25), (0.25, -0.25), (-0.25, 0.25))  # in samples
QUICK_SHIFTS = SHIFTS[:2]
PAN_STEPS, QUICK_PAN_STEPS = 3, 2
PAN_STEP_DEG = 0.1  # slow pan: a third of a pixel at the rim
DETAIL = (slice(40, 160), slice(200, 350))
BOUND_DB, SHIMMER_BOUND = 38.0, 1.0 / 3.0


def check(fixture: Fixture, title: str) -> Section:
    """Compare default quality and bilinear lookup with 256 samples per pixel, in a slow pan."""
    return measure_quality(fixture, fixture.scene, fixture.viewpoint_m, title)


def measure_quality(
    fixture: Fixture, scene: Scene, viewpoint_m: tuple[float, float, float], title: str
) -> Section:
    """Make the comparison of `check` in any scene, from a viewpoint in the world frame."""
    sensor = OmniCamera(polygons=None).resized(SIZE_PX)
    steps = QUICK_PAN_STEPS if fixture.is_quick else PAN_STEPS
    shifts = QUICK_SHIFTS if fixture.is_quick else SHIFTS
    headings_deg = 25.0 + PAN_STEP_DEG * np.arange(steps)
    poses = [sensor.base_pose(viewpoint_m, yaw_deg=heading) for heading in headings_deg]
    with Stage(scene, device=fixture.device) as stage:
        truth = _truth(stage, sensor, poses, shifts)
        ours = _linear_images(stage, sensor, poses)
        plain = _plain(stage, dataclasses.replace(sensor, face_size_px=PLAIN_FACE_PX), poses)
    seen: Bools = np.all(np.isfinite([truth[0], ours[0], plain[0]]), axis=(0, -1))
    shimmer, plain_shimmer = _shimmer(ours, truth, seen), _shimmer(plain, truth, seen)
    samples = len(shifts) * SAMPLES_PER_SIDE**2
    truth_name = f"{samples} samples per pixel"
    images = {truth_name: truth[0], "omnisim": ours[0], "plain bilinear": plain[0]}
    details = {
        name: srgb8_from_linear(np.nan_to_num(image[DETAIL])) for name, image in images.items()
    }
    return Section(
        title,
        f"The image at default quality, {SIZE_PX} × {SIZE_PX} px, against {samples} samples per "
        f"pixel; for comparison, a plain bilinear lookup in faces of {PLAIN_FACE_PX} px. Shimmer "
        f"is the change of the difference between successive images of a pan, with {steps} images "
        f"{PAN_STEP_DEG}° apart.",
        (
            Measure("default quality", psnr_db(ours[0], truth[0], seen), "dB", BOUND_DB,
                    at_least=True),
            Measure("shimmer, as a share of plain bilinear's", shimmer / plain_shimmer,
                    bound=SHIMMER_BOUND),
            Measure("plain bilinear", psnr_db(plain[0], truth[0], seen), "dB"),
            Measure("shimmer", shimmer, "levels of 255"),
            Measure("plain bilinear's shimmer", plain_shimmer, "levels of 255"),
        ),
        figures=[CaptionedFigure("image-quality", gallery(details, 3),
                 "Detail with edges and fine lines: many samples, omnisim, and plain bilinear.")],
    )  # fmt: skip


def _truth(
    stage: Stage, sensor: OmniCamera, poses: list[Floats], shifts: tuple[tuple[float, float], ...]
) -> list[Floats]:
    """Linear images with many samples per pixel, NaN where a capture sees nothing.

    The texels are as fine as the samples, and are drawn again for each shift.
    """
    finest = dataclasses.replace(
        sensor, supersampling=SAMPLES_PER_SIDE, texels_per_pixel=float(SAMPLES_PER_SIDE)
    )
    model = mirror_camera(sensor)
    total = [np.zeros((model.height_px, model.width_px, 3)) for _ in poses]
    for shift in shifts:
        u, v = np.add(model.principal_point_px, np.divide(shift, SAMPLES_PER_SIDE)).tolist()
        camera = dataclasses.replace(model, principal_point_px=(u, v))
        images = _linear_images(stage, dataclasses.replace(finest, model=camera), poses)
        total = [before + image for before, image in zip(total, images, strict=True)]
    return [image / len(shifts) for image in total]


def _linear_images(stage: Stage, sensor: OmniCamera, poses: list[Floats]) -> list[Floats]:
    images = []
    with stage.open(sensor) as renderer:
        for pose in poses:
            frame = renderer.render(pose, linear=True)
            images.append(np.where(frame.valid[..., None], linear_image(frame), np.nan))
    return images


def _plain(stage: Stage, sensor: OmniCamera, poses: list[Floats]) -> list[Floats]:
    """Linear images by one bilinear lookup in the faces, for the ray of each pixel's center."""
    camera = sensor.model
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    rig = rays.directions @ camera.rig_from_optical.T
    index = face_index(rig)
    tangents = face_tangents(rig, index)
    images = []
    with stage.open(sensor) as renderer:
        for pose in poses:
            renderer.render(pose)
            image = np.full((*index.shape, 3), np.nan)
            for name, pixels in renderer.faces().items():
                in_face = index == FACE_NAMES.index(name)
                texels = 0.5 * len(pixels) * (tangents[in_face] + 1.0) - 0.5
                linear = linear_from_srgb(pixels / 255.0)
                for channel in range(3):
                    image[in_face, channel] = bilinear.sample(linear[..., channel], texels)
            images.append(image)
    return images


def _shimmer(images: list[Floats], truth: list[Floats], seen: Bools) -> float:
    """RMS, in levels of 255, of the change of an image's error from one image to the next."""
    levels = [
        255.0 * (srgb_from_linear(image[seen]) - srgb_from_linear(true[seen]))
        for image, true in zip(images, truth, strict=True)
    ]
    return float(np.sqrt(np.mean(np.diff(levels, axis=0) ** 2)))
