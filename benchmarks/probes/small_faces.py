"""Virtual cameras with almost no fill: the cost of triangles and calls."""

from __future__ import annotations

import dataclasses

from benchmarks.pipeline_parts import RepeatedFrame
from benchmarks.probes.probe import Probe
from benchmarks.settings import at_setting
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.rendering.stage import Stage

FACE_PX = 16


def small_faces_probe(scene: str, stage: Stage) -> Probe:
    """Probe that draws a scene's faces with 16 × 16 texels each."""
    camera = dataclasses.replace(
        at_setting(OmniCamera(polygons=PAPER_POLYGONS), "fast"), face_size_px=FACE_PX
    )
    frame = RepeatedFrame.at_start(stage, camera)
    return Probe(small_faces_name(scene), "frames", 1.0, frame.render_faces)


def small_faces_name(scene: str) -> str:
    """Name of the probe."""
    return f"virtual cameras of {FACE_PX} px, {scene}"
