"""Physical mirror, traced by an independent renderer, against our captures."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import pixel_grid
from omnisim.core import coordinate_frames as frames
from omnisim.core.srgb import srgb_from_linear
from omnisim.plots.style import Figure, gallery
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.scene import Scene
from omnisim.validation.displacement import displacement_figure, displacements
from omnisim.validation.fixture import Fixture, linear_image, max_abs, mean_abs, mirror_camera
from omnisim.validation.markers import centroids, inside_valid_area, marker_positions, marker_scene
from omnisim.validation.oracles.mitsuba_tracer import trace_mirror
from omnisim.validation.oracles.surfaces import opaque_only
from omnisim.validation.psnr import noise_floor_db, psnr_db

SIZE_PX, QUICK_SIZE_PX = 512, 256
SAMPLES, QUICK_SAMPLES = 144, 64  # squares, as its sampler wants
FINE = 4  # supersampling of the image that shows the share of antialiasing in the difference
MARKERS = 60
BOUND_DB, FINE_BOUND_DB = 32.0, 40.0
MARKER_BOUND_PX, SHIFT_BOUND_PX = 0.1, 0.1


class Pair(NamedTuple):
    """Two traced images with different seeds, and a mask of comparable pixels."""

    traced: NDArray[np.float32]
    again: NDArray[np.float32]
    inside: NDArray[np.bool_]


def check(fixture: Fixture, title: str) -> Section:
    """Compare omnisim's images of the textured scene and of markers with Mitsuba's real mirror."""
    size = QUICK_SIZE_PX if fixture.is_quick else SIZE_PX
    samples = QUICK_SAMPLES if fixture.is_quick else SAMPLES
    sensor = OmniCamera().with_polygons(None).resized(size)
    scene, pose = opaque_only(fixture.scene), sensor.base_pose(fixture.viewpoint_m, yaw_deg=20.0)
    pair = _trace(scene, sensor, pose, samples)
    exact = _linear(fixture, scene, sensor, pose)
    mesh = _linear(fixture, scene, sensor.with_polygons(PAPER_POLYGONS), pose)
    fine = _linear(
        fixture,
        scene,
        dataclasses.replace(sensor, supersampling=FINE, texels_per_pixel=float(FINE)),
        pose,
    )
    shifts = displacements(_gray(pair.traced), _gray(fine), pair.inside)
    lengths = np.linalg.norm(shifts.shifts_px, axis=1)
    markers = _marker_distances(fixture, sensor.resized(SIZE_PX), pose)
    floor = noise_floor_db(pair.traced, pair.again, pair.inside)
    return Section(
        title,
        f"omnisim's image against Mitsuba's path tracer, with {samples} rays per pixel from a real "
        "pinhole to a real mirror, a mesh of the hyperboloid with an error of 0.001 px, and into "
        "the textured scene, whose surfaces emit their base colors. Mitsuba uses neither omnisim's "
        f"rays nor ξ. Its noise is {floor:.1f} dB. The remaining difference from the default image "
        f"is antialiasing: with {FINE} × {FINE} samples per pixel it is smaller.",
        (
            Measure("exact capture, default quality", psnr_db(pair.traced, exact, pair.inside),
                    "dB", BOUND_DB, at_least=True),
            Measure(f"exact capture, {FINE} × {FINE} samples per pixel",
                    psnr_db(pair.traced, fine, pair.inside), "dB", FINE_BOUND_DB, at_least=True),
            Measure("markers, mean distance", mean_abs(markers), "px", MARKER_BOUND_PX),
            Measure("markers, largest distance", max_abs(markers), "px", 2.0 * MARKER_BOUND_PX),
            Measure("shift of the texture's edges, mean", mean_abs(lengths), "px", SHIFT_BOUND_PX),
            Measure("size", size, "px"),
            Measure("samples per pixel", samples),
            Measure("noise floor", floor, "dB"),
            Measure("1024 polygons, default quality", psnr_db(pair.traced, mesh, pair.inside),
                    "dB"),
            Measure("markers", len(markers)),
            Measure("patches with edges", len(lengths)),
            Measure("shift of the texture's edges, 95 %", float(np.percentile(lengths, 95)), "px"),
        ),
        figures=(
            CaptionedFigure("traced-mirror", _gallery(pair, exact),
                    "Traced mirror, omnisim's exact capture, and their difference × 8: differences "
                    "are at edges only, equally on both sides."),
            CaptionedFigure("traced-shifts",
                    displacement_figure("Traced mirror − ours", sensor.model, *shifts),
                    "Shifts of image patches between the two images, × 300."),
        ),
    )  # fmt: skip


def _trace(scene: Scene, sensor: OmniCamera, pose: NDArray[np.float64], samples: int) -> Pair:
    camera, world_from_optical = mirror_camera(sensor), _world_from_optical(sensor, pose)
    traced, again = (
        trace_mirror(scene, camera, world_from_optical, samples, seed=seed) for seed in (0, 1)
    )
    off_axis = pixel_grid(camera.width_px, camera.height_px) - camera.principal_point_px
    # pixels at the rim blend with the background of the mirror
    inside = np.linalg.norm(off_axis, axis=-1) < camera.rim_radius_px - 2.0
    return Pair(traced, again, inside)


def _marker_distances(
    fixture: Fixture, sensor: OmniCamera, pose: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances (n,) between the centers of markers in the traced image and in ours."""
    camera, world_from_optical = mirror_camera(sensor), _world_from_optical(sensor, pose)
    viewpoint_m = world_from_optical[:3, 3]
    positions = marker_positions(
        viewpoint_m, -world_from_optical[:3, 2], camera.mirror.theta_max_rad, MARKERS
    )
    near_px = camera.pixel_from_ray(
        (positions - viewpoint_m) @ world_from_optical[:3, :3]
    ).positions_px
    clear = inside_valid_area(camera, near_px)
    scene = marker_scene(positions[clear], viewpoint_m)
    traced = trace_mirror(scene, camera, world_from_optical, 64)
    ours = _linear(fixture, scene, sensor, pose)
    one = centroids(traced[..., 1].astype(np.float64), near_px[clear])
    other = centroids(ours[..., 1].astype(np.float64), near_px[clear])
    return np.linalg.norm(one - other, axis=1)


def _world_from_optical(sensor: OmniCamera, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    world_from_optical = pose @ sensor.base_from_rig
    world_from_optical[:3, :3] = world_from_optical[:3, :3] @ frames.RIG_FROM_OPTICAL_LOOKING_UP
    return world_from_optical


def _linear(
    fixture: Fixture, scene: Scene, sensor: OmniCamera, pose: NDArray[np.float64]
) -> NDArray[np.float32]:
    return linear_image(fixture.render(scene, sensor, pose))


def _gray(linear: NDArray[np.float32]) -> NDArray[np.float64]:
    gray: NDArray[np.float64] = srgb_from_linear(linear).mean(axis=-1)
    return 255.0 * gray


def _gallery(pair: Pair, exact: NDArray[np.float32]) -> Figure:
    shown = np.where(pair.inside[..., None], pair.traced, 0.0)
    ours = np.where(pair.inside[..., None], exact, 0.0)
    off = np.abs(srgb_from_linear(shown) - srgb_from_linear(ours))
    enhanced = np.rint(255.0 * np.clip(8.0 * off, 0.0, 1.0)).astype(np.uint8)
    images = {"traced by Mitsuba": shown, "captured by omnisim": ours}
    return gallery(images | {"difference × 8": enhanced}, 3, side_in=4.2)
