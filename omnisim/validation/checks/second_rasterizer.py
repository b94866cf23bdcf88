"""A second rasterizer: each virtual camera of the cube against pyrender."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES
from omnisim.core.srgb import linear_from_srgb
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.validation.fixture import Fixture
from omnisim.validation.oracles.pyrender_rasterizer import rasterize
from omnisim.validation.oracles.surfaces import opaque_only
from omnisim.validation.psnr import psnr_db

SIZE_PX = 1024
# Averages over blocks, in linear light, reduce edges and leave shapes and colors.
AVERAGED = 4
BOUND_DB, AVERAGED_BOUND_DB = 35.0, 40.0


def check(fixture: Fixture, title: str) -> Section:
    """Render five faces with both rasterizers and compare them, directly and averaged."""
    size = SIZE_PX
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
        one, other = linear_from_srgb(ours / 255.0), linear_from_srgb(theirs[name] / 255.0)
        plain.append(psnr_db(one, other, everywhere))
        blocks = everywhere[::AVERAGED, ::AVERAGED]
        averaged.append(psnr_db(_averaged(one), _averaged(other), blocks))
        rows.append((name, f"{plain[-1]:.1f}", f"{averaged[-1]:.1f}"))
    images = {"front, omnisim": faces["front"], "front, pyrender": theirs["front"]}
    images |= {"down, omnisim": faces["down"], "down, pyrender": theirs["down"]}
    return Section(
        title,
        f"{len(chosen)} of the five virtual cameras at {size} × {size} px against pyrender, plain "
        "base colors. pyrender blends edges and textures in sRGB values, omnisim in linear light. "
        f"Averages over {AVERAGED} × {AVERAGED} pixels in linear light reduce this difference, and "
        "so compare shapes and colors.",
        (
            Measure("worst face, as it is", min(plain), "dB", BOUND_DB, at_least=True),
            Measure("worst face, averaged", min(averaged), "dB", AVERAGED_BOUND_DB, at_least=True),
        ),
        tables=(
            ResultTable("PSNR of each face in dB", ("face", "as it is", "averaged"), tuple(rows)),
        ),
        figures=(
            CaptionedFigure("faces", gallery(images, 2), "Two of the faces by both: the same."),
        ),
    )


def _averaged(image: NDArray[np.float64]) -> NDArray[np.float64]:
    height, width, channels = image.shape
    blocks = image.reshape(height // AVERAGED, AVERAGED, width // AVERAGED, AVERAGED, channels)
    return blocks.mean(axis=(1, 3))
