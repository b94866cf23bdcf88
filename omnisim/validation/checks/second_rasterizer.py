"""A second rasterizer: each virtual camera of the cube against pyrender."""

from __future__ import annotations

import numpy as np

from omnisim.cameras import PerspectiveCamera
from omnisim.core.arrays import Bytes
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES
from omnisim.core.srgb import linear_from_srgb
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.validation.fixture import Fixture
from omnisim.validation.image_differences import psnr_db
from omnisim.validation.oracles.pyrender_rasterizer import rasterize
from omnisim.validation.oracles.surfaces import opaque_only

SIZE_PX = 1024
# Averages over blocks, in linear light, reduce edges and leave shapes and colors.
AVERAGED = 4
BOUND_DB, AVERAGED_BOUND_DB = 35.0, 40.0


def check(fixture: Fixture, title: str) -> Section:
    """Render five faces with both rasterizers and compare them, directly and averaged."""
    size, blocks_px = SIZE_PX, SIZE_PX // AVERAGED
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
            Measure("worst face, as it is", min(plain), "dB", BOUND_DB, at_least=True),
            Measure("worst face, averaged", min(averaged), "dB", AVERAGED_BOUND_DB, at_least=True),
        ),
        tables=(
            ResultTable("PSNR of each face in dB", ("face", "as it is", "averaged"), tuple(rows)),
        ),
        figures=[CaptionedFigure("faces", gallery(images, 2), "Two of the faces by both.")],
    )
