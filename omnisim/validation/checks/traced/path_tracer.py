"""Physical mirror, traced by an independent renderer, against our captures."""

from __future__ import annotations

import dataclasses

import numpy as np

from omnisim.core import coordinate_frames as frames
from omnisim.core.arrays import Floats
from omnisim.core.srgb import srgb_from_linear
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.validation.fixture import Fixture, linear_image, max_abs, mean_abs, mirror_camera
from omnisim.validation.image_differences import (
    displacement_figure,
    displacements,
    noise_floor_db,
    psnr_db,
)
from omnisim.validation.markers import centroids, inside_valid_area, marker_positions, marker_scene
from omnisim.validation.oracles.mitsuba_tracer import trace_mirror
from omnisim.validation.oracles.surfaces import opaque_only
from omnisim.validation.traced_light import beside, inside_rim

SIZE_PX, QUICK_SIZE_PX = 512, 256
SAMPLES, QUICK_SAMPLES = 144, 64  # squares, as its sampler wants
FINE = 4  # supersampling of the image that shows the share of antialiasing in the difference
MARKERS = 60
BOUND_DB, FINE_BOUND_DB = 32.0, 40.0
MARKER_BOUND_PX, SHIFT_BOUND_PX = 0.1, 0.1


def check(fixture: Fixture, title: str) -> Section:
    """Compare omnisim's images of the textured scene and of markers with Mitsuba's real mirror."""
    size = QUICK_SIZE_PX if fixture.is_quick else SIZE_PX
    samples = QUICK_SAMPLES if fixture.is_quick else SAMPLES
    sensor = OmniCamera().with_polygons(None).resized(size)
    scene, pose = opaque_only(fixture.scene), sensor.base_pose(fixture.viewpoint_m, yaw_deg=20.0)
    camera, world_from_optical = mirror_camera(sensor), _world_from_optical(sensor, pose)
    traced, again = (
        trace_mirror(scene, camera, world_from_optical, samples, seed=seed) for seed in (0, 1)
    )
    inside = inside_rim(sensor)
    finer = dataclasses.replace(sensor, supersampling=FINE, texels_per_pixel=float(FINE))
    exact, mesh, fine = (
        linear_image(fixture.render(scene, each, pose))
        for each in (sensor, sensor.with_polygons(PAPER_POLYGONS), finer)
    )
    exact_db, mesh_db, fine_db = (psnr_db(traced, image, inside) for image in (exact, mesh, fine))
    theirs, ours = (255.0 * srgb_from_linear(image).mean(axis=-1) for image in (traced, fine))
    shifts = displacements(theirs, ours, inside)
    lengths = np.linalg.norm(shifts.shifts_px, axis=1)
    markers = _marker_distances(fixture, sensor.resized(SIZE_PX), pose)
    floor = noise_floor_db(traced, again, inside)
    return Section(
        title,
        f"omnisim's image against Mitsuba's path tracer, with {samples} rays per pixel from a real "
        "pinhole to a real mirror, a mesh of the hyperboloid with an error of 0.001 px, and into "
        "the textured scene, whose surfaces emit their base colors. Mitsuba uses neither omnisim's "
        f"rays nor ξ. Its noise is {floor:.1f} dB. The remaining difference from the default image "
        f"is antialiasing: with {FINE} × {FINE} samples per pixel it is smaller.",
        (
            Measure("exact capture, default quality", exact_db, "dB", BOUND_DB, at_least=True),
            Measure(f"exact capture, {FINE} × {FINE} samples per pixel", fine_db, "dB",
                    FINE_BOUND_DB, at_least=True),
            Measure("markers, mean distance", mean_abs(markers), "px", MARKER_BOUND_PX),
            Measure("markers, largest distance", max_abs(markers), "px", 2.0 * MARKER_BOUND_PX),
            Measure("shift of the texture's edges, mean", mean_abs(lengths), "px", SHIFT_BOUND_PX),
            Measure("size", size, "px"),
            Measure("samples per pixel", samples),
            Measure("noise floor", floor, "dB"),
            Measure("1024 polygons, default quality", mesh_db, "dB"),
            Measure("markers", len(markers)),
            Measure("patches with edges", len(lengths)),
            Measure("shift of the texture's edges, 95 %", float(np.percentile(lengths, 95)), "px"),
        ),
        figures=(
            CaptionedFigure("traced-mirror",
                    gallery(beside("", traced, exact, inside), 3, side_in=4.2),
                    "Traced mirror, omnisim's exact capture, and their difference × 8: differences "
                    "are at edges only, equally on both sides."),
            CaptionedFigure("traced-shifts",
                    displacement_figure("Traced mirror − ours", sensor.model, *shifts),
                    "Shifts of image patches between the two images, × 300."),
        ),
    )  # fmt: skip


def _marker_distances(fixture: Fixture, sensor: OmniCamera, pose: Floats) -> Floats:
    """Distances (n,) between the centers of markers in the traced image and in ours."""
    camera, world_from_optical = mirror_camera(sensor), _world_from_optical(sensor, pose)
    viewpoint_m = world_from_optical[:3, 3]
    axis = -world_from_optical[:3, 2]
    positions = marker_positions(viewpoint_m, axis, camera.mirror.theta_max_rad, MARKERS)
    rays = (positions - viewpoint_m) @ world_from_optical[:3, :3]
    near_px = camera.pixel_from_ray(rays).positions_px
    clear = inside_valid_area(camera, near_px)
    scene = marker_scene(positions[clear], viewpoint_m)
    traced = trace_mirror(scene, camera, world_from_optical, 64)
    ours = linear_image(fixture.render(scene, sensor, pose))
    by_mitsuba, by_omnisim = (
        centroids(image[..., 1].astype(np.float64), near_px[clear]) for image in (traced, ours)
    )
    return np.linalg.norm(by_mitsuba - by_omnisim, axis=1)


def _world_from_optical(sensor: OmniCamera, pose: Floats) -> Floats:
    world_from_optical = pose @ sensor.base_from_rig
    world_from_optical[:3, :3] = world_from_optical[:3, :3] @ frames.RIG_FROM_OPTICAL_LOOKING_UP
    return world_from_optical
