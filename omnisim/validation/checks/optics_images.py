"""Real mirrors and windows of optical systems, traced by Mitsuba, against our images."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.cameras.optics import OpticalSystem
from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.scene import Scene, load_scene
from omnisim.validation.fixture import Fixture, linear_image, max_abs, mean_abs
from omnisim.validation.image_differences import psnr_db
from omnisim.validation.optical_systems import validation_systems
from omnisim.validation.oracles.mitsuba_optics import PhysicalOptics
from omnisim.validation.oracles.surfaces import opaque_only
from omnisim.validation.plain_scenes import centroids, marker_pixels, markers_on_rays
from omnisim.validation.traced_light import beside

SCENE = "soccer"
# Mitsuba's samples per pixel: squares, as its sampler requires. Images in mirrors have more,
# windows need twice as many, see `PhysicalOptics`, and markers are averages over many pixels.
MIRROR_SAMPLES, SAMPLES = 36, 16
SPACING_PX = 40  # between markers
SINGLE_RAYS = 250
FINE = 6  # supersampling of the image that shows the share of antialiasing in the difference
SQUEEZED = "cone"
QUICK = ("sphere", "flat port")
BOUND_DB, SQUEEZED_BOUND_DB, FINE_BOUND_DB = 38.0, 35.0, 41.0
MEAN_BOUND_PX, MAX_BOUND_PX, RAY_BOUND_PX = 0.05, 0.15, 0.005
_RIM_PX = 3  # excluded at the edge of the visible area, where pixels blend


class Comparison(NamedTuple):
    """Linear images (height, width, 3) by both renderers, and a mask of the visible area."""

    traced: Floats32
    ours: Floats32
    inside: Bools

    @property
    def decibels(self) -> float:
        """PSNR inside the visible area."""
        return psnr_db(self.traced, self.ours, self.inside)


@dataclasses.dataclass(frozen=True)
class TracedSystem:
    """Optical system at a viewpoint in a scene, traced by Mitsuba and rendered by omnisim."""

    fixture: Fixture
    system: OpticalSystem
    viewpoint_m: tuple[float, float, float]

    @cached_property
    def sensor(self) -> OmniCamera:
        """Our camera, at default quality."""
        return OmniCamera(self.system)

    @cached_property
    def pose(self) -> Floats:
        """Pose (4, 4) world_from_base."""
        return self.sensor.base_pose(self.viewpoint_m, yaw_deg=20.0)

    @property
    def world_from_optical(self) -> Floats:
        """Pose (4, 4) of the optical frame."""
        return self.pose @ self.sensor.base_from_optical

    @cached_property
    def optics(self) -> PhysicalOptics:
        """Physical mirrors and windows in Mitsuba."""
        return PhysicalOptics(self.system, self.world_from_optical)

    def ours(self, scene: Scene, supersampling: int | None = None) -> Floats32:
        """Linear image by omnisim; by default at default quality."""
        sensor = self.sensor
        if supersampling is not None:
            sensor = dataclasses.replace(
                sensor, supersampling=supersampling, texels_per_pixel=float(supersampling)
            )
        return linear_image(self.fixture.render(scene, sensor, self.pose))

    def compare(self, scene: Scene) -> Comparison:
        """Compare images of a scene of opaque surfaces."""
        around = np.ones((2 * _RIM_PX + 1,) * 2, dtype=np.bool_)
        inside = scipy.ndimage.binary_erosion(self.system.all_rays().valid, around)
        is_mirror = all(surface.is_mirror for surface in self.system.surfaces)
        traced = self.optics.image(scene, MIRROR_SAMPLES if is_mirror else SAMPLES)
        return Comparison(traced, self.ours(scene), inside)

    def marker_distances_px(self) -> Floats:
        """Distances (n,) between the centers of markers in both images; NaN: a marker is lost."""
        pixels = marker_pixels(self.system, SPACING_PX)
        scene = markers_on_rays(self.system, pixels, self.world_from_optical)
        images = self.optics.image(scene, SAMPLES), self.ours(scene)
        traced, ours = (centroids(image[..., 1].astype(np.float64), pixels) for image in images)
        return np.linalg.norm(traced - ours, axis=1)

    def ray_errors_px(self) -> Floats:
        """Distances (n,) between pixels and our projections of points at 1 m on Mitsuba's rays."""
        generator = np.random.default_rng(0)
        low, high = (10.0, 10.0), (self.system.width_px - 11.0, self.system.height_px - 11.0)
        pixels = generator.uniform(low, high, (SINGLE_RAYS, 2))
        pixels = pixels[self.system.rays(pixels).valid]
        origins_m, directions = self.optics.rays(pixels)
        seen = self.system.pixel_from_point(origins_m + directions).positions_px
        return np.linalg.norm(seen - pixels, axis=1)


class ImageResult(NamedTuple):
    """Differences between Mitsuba and omnisim for one system."""

    markers_px: Floats
    rays_px: Floats
    images: Comparison
    fine_db: float | None  # PSNR with many samples per pixel; None: default quality is enough


def check(fixture: Fixture, title: str) -> Section:
    """Trace images and markers through the systems' physical surfaces, and compare."""
    scene = opaque_only(load_scene(SCENE))
    results = {}
    for name, system in validation_systems().items():
        if fixture.is_quick and name not in QUICK:
            continue
        traced = TracedSystem(fixture, system, scene.start.position_m)
        compared = traced.compare(scene)
        fine_db = None
        if name == SQUEEZED:
            fine_db = compared._replace(ours=traced.ours(scene, FINE)).decibels
        distances_px = traced.marker_distances_px(), traced.ray_errors_px()
        results[name] = ImageResult(*distances_px, compared, fine_db)
    markers = [result.markers_px for result in results.values()]
    most = [result.images.decibels for name, result in results.items() if name != SQUEEZED]
    measures = [
        Measure("markers, mean distance in any system", max(map(mean_abs, markers)), "px",
                MEAN_BOUND_PX),
        Measure("markers, largest distance", max(map(max_abs, markers)), "px", MAX_BOUND_PX),
        Measure("worst image at default quality, except the cone's", min(most), "dB", BOUND_DB,
                at_least=True),
        Measure("Mitsuba's single rays against ours, largest distance at 1 m",
                max(max_abs(result.rays_px) for result in results.values()), "px", RAY_BOUND_PX),
    ]  # fmt: skip
    rows, images = [], dict[str, NDArray[np.generic]]()
    for name, result in results.items():
        if result.fine_db is not None:
            measures += [
                Measure(f"{name}: image at default quality", result.images.decibels, "dB",
                        SQUEEZED_BOUND_DB, at_least=True),
                Measure(f"{name}: image with {FINE} × {FINE} samples per pixel", result.fine_db,
                        "dB", FINE_BOUND_DB, at_least=True),
            ]  # fmt: skip
        off_px = result.markers_px
        centers = str(len(off_px)), f"{mean_abs(off_px):.3f}, {max_abs(off_px):.3f}"
        ray, decibels = f"{max_abs(result.rays_px):.4f}", f"{result.images.decibels:.1f}"
        rows.append((name, *centers, ray, decibels))
        images |= beside(name, *result.images)
    columns = ("system", "markers", "mean, largest px", "single rays, largest px", "image, dB")
    return Section(
        title,
        f"omnisim's images against Mitsuba's path tracer, with {MIRROR_SAMPLES} rays per pixel "
        f"from a pinhole to real mirrors, or {SAMPLES} through real windows. Mirrors are metal "
        "meshes; windows are spheres and planes of a smooth dielectric. The rays continue into "
        f"`{SCENE}`, whose surfaces emit their base colors. Mitsuba does not use omnisim's rays. "
        "The error of its own rays, by facets, float32 and ray offsets at surfaces, is at most a "
        "tenth of the bound for markers. Markers are discs perpendicular to the rays of pixels, "
        "0.4 to 8 m away, on black. A cone maps whole walls to a few pixels around its tip, where "
        f"{OmniCamera().supersampling} × {OmniCamera().supersampling} samples are too few; with "
        f"{FINE} × {FINE} samples it is as accurate as the others.",
        measures,
        (ResultTable("Distances between Mitsuba's images and ours", columns, tuple(rows)),),
        [CaptionedFigure("traced-optics", gallery(images, 6, 2.0),
                         "Images by Mitsuba and omnisim, and their difference × 8.")],
    )  # fmt: skip
