"""Fig. 8 and 9: error of the mirror's mesh by the number of polygons."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from omnisim.cameras import pixel_grid
from omnisim.cameras.mirrors.mirror_mesh import PAPER_POLYGON_COUNTS
from omnisim.core.arrays import Bytes, Floats
from omnisim.plots.style import BLUE, GRAY, ORANGE, gallery, plot
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.rendering.camera.quality import MAX_ERROR_PX
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.gl.context import open_context
from omnisim.rendering.stage import Stage
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.validation.fixture import Fixture, linear_image, mirror_camera
from omnisim.validation.image_differences import psnr_db

DEFAULT_SIZES_PX = (360, 1024)
DETAIL = (slice(4, 64), slice(140, 224))  # rows and columns of the 360 px image


class MeshResult(NamedTuple):
    """Errors of one mesh's image."""

    error_px: Floats  # (pixels,) between mesh and mirror
    psnr_db: float  # against the exact capture, where both show the scene
    image: Bytes


def check(fixture: Fixture, title: str) -> Section:
    """Render the textured scene by meshes of 16 to 4096 polygons and exactly."""
    sensor = OmniCamera()
    pose = sensor.base_pose(fixture.viewpoint_m)
    with Stage(fixture.scene, device=fixture.device) as stage:
        exact, *frames = (
            fixture.render(stage, sensor.with_polygons(polygons), pose)
            for polygons in (None, *PAPER_POLYGON_COUNTS)
        )
    results = {}
    for polygons, frame in zip(PAPER_POLYGON_COUNTS, frames, strict=True):
        error = shown_error_px(fixture, sensor.with_polygons(polygons))
        psnr = psnr_db(linear_image(frame), linear_image(exact), frame.valid & exact.valid)
        results[polygons] = MeshResult(error, psnr, frame.rgb)
    means = [results[polygons].error_px.mean() for polygons in PAPER_POLYGON_COUNTS]
    slope = float(np.polyfit(np.log(PAPER_POLYGON_COUNTS), np.log(means), 1)[0])
    paper = results[PAPER_POLYGONS]
    counts = np.array(PAPER_POLYGON_COUNTS)
    largest = [results[polygons].error_px.max() for polygons in PAPER_POLYGON_COUNTS]
    figure, axes = plot("Geometric error of a mesh", "polygons", "error in pixels at 360 × 360")
    axes.loglog(counts, largest, "s-", color=ORANGE, label="largest")
    axes.loglog(counts, means, "o-", color=BLUE, label=f"mean, slope {slope:.3f}".replace("-", "−"))
    axes.loglog(counts, means[0] * counts[0] / counts, "--", color=GRAY, label="slope −1")
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.minorticks_off()
    axes.legend(frameon=False)
    defaults = [sensor.resized(size) for size in DEFAULT_SIZES_PX]
    rows = tuple(
        (
            str(polygons),
            f"{result.error_px.mean():.3f}",
            f"{np.percentile(result.error_px, 95):.3f}",
            f"{result.error_px.max():.3f}",
            f"{result.psnr_db:.1f}",
        )
        for polygons, result in results.items()
    )
    views = {f"{polygons} polygons": result.image for polygons, result in results.items()}
    views["exact"] = exact.rgb
    return Section(
        title,
        "Images of 360 × 360 px by mirror meshes, against the exact capture. The error is the "
        "distance between a direction's positions in the images of mesh and mirror, from the GPU's "
        "rays. It is inversely proportional to the number of polygons. As in the paper, 256 "
        "polygons visibly bend straight lines, 1024 do not, and 4096 bring no visible gain. The "
        "default number keeps the largest error below 0.1 px at the image's size.",
        (
            Measure("slope of the log-log line, distance from −1", abs(slope + 1.0), bound=0.1),
            Measure("1024 polygons, mean error", float(paper.error_px.mean()), "px", 0.20),
            Measure("1024 polygons, largest error", float(paper.error_px.max()), "px", 0.40),
            *(
                Measure(f"default, {each.mesh_polygons} polygons, {each.model.width_px} px: "
                        "largest error", float(shown_error_px(fixture, each).max()), "px",
                        MAX_ERROR_PX)
                for each in defaults
            ),
            Measure("slope", slope),
        ),
        (ResultTable("Meshes against the exact capture, 360 × 360 px",
                     ("polygons", "mean px", "95 % px", "max px", "PSNR dB"), rows),),
        (
            CaptionedFigure("fig8-polygons", gallery(views, 3),
                    "The same view with increasing numbers of polygons, and the exact capture."),
            CaptionedFigure("fig9-detail",
                    gallery({name: image[DETAIL] for name, image in views.items()}, 3),
                    "The same detail, magnified: lines are jagged up to 256 polygons."),
            CaptionedFigure("convergence", figure,
                    "Error over the number of polygons: inversely proportional."),
        ),
    )  # fmt: skip


def shown_error_px(fixture: Fixture, sensor: OmniCamera) -> Floats:
    """Distances (n,) from pixels to the positions at which the mirror shows the pixels' rays.

    Pixels whose rays are past the rim are left out.
    """
    camera = mirror_camera(sensor)
    context = open_context(fixture.device)
    try:
        with context:
            rays, seen = PixelMap(context, camera, sensor.mesh_polygons).read_rays()
    finally:
        context.release()
    shown = camera.pixel_from_ray(rays[seen].astype(np.float64))
    pixels = pixel_grid(camera.width_px, camera.height_px)[seen]
    # directions past the rim, which a mesh may show, have no position in the mirror's image
    errors: Floats = np.linalg.norm(shown.positions_px - pixels, axis=-1)
    return errors[shown.valid]
