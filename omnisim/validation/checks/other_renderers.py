"""Images against a second rasterizer, a ray caster, and many samples per pixel."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from omnisim.cameras import EquidistantCamera, PerspectiveCamera, pixel_grid
from omnisim.core import bilinear
from omnisim.core.arrays import Bools, Bytes, Floats
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES, face_index, face_tangents
from omnisim.core.srgb import linear_from_srgb, srgb8_from_linear, srgb_from_linear
from omnisim.ground_truth.frame import Frame
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.shared_scene import BackendName
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.scene import Scene, load_scene
from omnisim.validation.fixture import TEXTURED_SCENE, Fixture, linear_image, mirror_camera
from omnisim.validation.image_differences import psnr_db, psnr_of_levels_db
from omnisim.validation.oracles.pyrender_rasterizer import rasterize
from omnisim.validation.oracles.surfaces import opaque_only

FACE_PX = 1024
# Averages over blocks, in linear light, reduce edges and leave shapes and colors.
AVERAGED = 4
FACE_BOUND_DB, AVERAGED_BOUND_DB = 35.0, 40.0


def check_rasterizer(fixture: Fixture, title: str) -> Section:
    """Render five faces with both rasterizers and compare them, directly and averaged."""
    size, blocks_px = FACE_PX, FACE_PX // AVERAGED
    scene = opaque_only(fixture.scene)
    sensor = OmniCamera(face_size_px=size, samples=4)
    world_from_base = sensor.base_pose(fixture.viewpoint_m, yaw_deg=25.0)
    with open_sensor(scene, sensor, unlit=True, device=fixture.device) as renderer:
        renderer.render(world_from_base)
        faces = renderer.faces()
    camera = PerspectiveCamera.with_field_of_view(size, size, 0.5 * np.pi)
    rows, plain, averaged, theirs = [], [], [], {}
    everywhere = np.ones((size, size), dtype=bool)
    # the quick report has the three with the largest differences in content
    chosen = ("front", "left", "down") if fixture.is_quick else tuple(faces)
    for name in chosen:
        ours = faces[name]
        pose = world_from_base.copy()
        pose[:3, :3] = world_from_base[:3, :3] @ FACE_FROM_RIG[FACE_NAMES.index(name)].T
        theirs[name] = rasterize(scene, camera, pose)
        first, second = (linear_from_srgb(values / 255.0) for values in (ours, theirs[name]))
        blocks = [
            image.reshape(blocks_px, AVERAGED, blocks_px, AVERAGED, 3).mean(axis=(1, 3))
            for image in (first, second)
        ]
        plain.append(psnr_db(first, second, everywhere))
        averaged.append(psnr_db(blocks[0], blocks[1], everywhere[::AVERAGED, ::AVERAGED]))
        rows.append((name, f"{plain[-1]:.1f}", f"{averaged[-1]:.1f}"))
    images: dict[str, Bytes] = {}
    for name in ("front", "down"):
        images |= {f"{name}, omnisim": faces[name], f"{name}, pyrender": theirs[name]}
    return Section(
        title,
        f"{len(chosen)} of the five virtual cameras at {size} × {size} px against pyrender, plain "
        "base colors. pyrender blends edges and textures in sRGB values, omnisim in linear light. "
        f"Averages over {AVERAGED} × {AVERAGED} pixels in linear light reduce this difference, and "
        "so compare shapes and colors.",
        (
            Measure("worst face, per pixel", min(plain), "dB", FACE_BOUND_DB, at_least=True),
            Measure("worst face, averaged", min(averaged), "dB", AVERAGED_BOUND_DB, at_least=True),
        ),
        tables=(
            ResultTable("PSNR of each face in dB", ("face", "per pixel", "averaged"), tuple(rows)),
        ),
        figures=[CaptionedFigure("faces", gallery(images, 2), "Two of the faces by both.")],
    )


# A ray caster: images and ground truth of the virtual cameras against Embree's rays.
#
# The geometry is Embree's, and appearance is recomputed in NumPy: the back ends share only the
# camera models, the mip levels of textures, and the degradation, which is left out here.


SCENES = (TEXTURED_SCENE, "soccer", "mapping")
RAYS_BOUND_DB = 36.0
# Shares of pixels, in the courtyard: a ray hits a leaf if its texture is opaque at that exact
# point, the cube if its texel shows the leaf.
BOUND_SAME_PERCENT = 97.5
SAME_RANGE = 1e-3  # share of the range within which hits are equal
_SHOWN_FACTOR = 4  # of differences in the figure


def check_rays(fixture: Fixture, title: str) -> Section:
    """Render images with both back ends, and compare colors and visible surfaces."""
    images: dict[str, Bytes] = {}
    rows, worst_db, worst_percent = [], math.inf, math.inf
    fisheye = EquidistantCamera(360, 360, 100.0, (179.5, 179.5), math.radians(100.0))
    sensors = {"mirror": OmniCamera(), "fisheye": OmniCamera(fisheye)}
    for name in SCENES[:1] if fixture.is_quick else SCENES:
        scene = load_scene(name, baked="none", sky="none")
        # a single sample of a surface brighter than white would saturate its whole pixel
        materials = [
            dataclasses.replace(each, emissive=tuple(np.minimum(each.emissive, 1.0).tolist()))
            for each in scene.materials
        ]
        scene = dataclasses.replace(scene, materials=tuple(materials))
        for lens, sensor in sensors.items():
            cube = _frame(scene, sensor, "cube", fixture.device)
            rays = _frame(scene, sensor, "rays", None)
            seen = cube.valid & rays.valid
            decibels = psnr_of_levels_db(cube.rgb[seen], rays.rgb[seen])
            cube_m, rays_m = cube.channels["range"], rays.channels["range"]
            same = cube.channels["instance"] == rays.channels["instance"]
            same &= np.isclose(cube_m, rays_m, SAME_RANGE, 0.0, equal_nan=True)
            percent = 100.0 * float(np.mean(same[cube.has_ray]))
            worst_db, worst_percent = min(worst_db, decibels), min(worst_percent, percent)
            rows.append((name, lens, f"{decibels:.1f}", f"{percent:.2f}"))
            if name == TEXTURED_SCENE:
                off = _SHOWN_FACTOR * np.abs(cube.rgb.astype(np.int16) - rays.rgb)
                images |= {
                    f"{lens}, cube": cube.rgb,
                    f"{lens}, rays": rays.rgb,
                    f"{lens}, difference": np.minimum(off, 255).astype(np.uint8),
                }
    return Section(
        title,
        "Images by virtual cameras against images by Embree's rays, with 3 × 3 samples per pixel, "
        "at default quality and in even light. A pixel shows the same surface if the ray of its "
        f"center has the same instance, and the same range within {100 * SAME_RANGE:g} %.",
        (
            Measure("worst image", worst_db, "dB", RAYS_BOUND_DB, at_least=True),
            Measure("the same surface", worst_percent, "%", BOUND_SAME_PERCENT, at_least=True),
        ),
        tables=(ResultTable("PSNR in dB, and pixels of the same surface in %",
                            ("scene", "camera", "PSNR", "same surface"), tuple(rows)),),
        figures=[CaptionedFigure("rays", gallery(images, 3),
                 f"Images by both; differences are shown {_SHOWN_FACTOR} times as large.")],
    )  # fmt: skip


def _frame(scene: Scene, sensor: OmniCamera, backend: BackendName, device: int | None) -> Frame:
    base = sensor.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
    with open_sensor(scene, sensor, backend=backend, device=device) as renderer:
        return renderer.render(base, also=("range", "instance"))


# Image quality: comparison with 256 samples per pixel, and shimmer in a slow pan.


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


def check_quality(fixture: Fixture, title: str) -> Section:
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
