"""What a sensor's passes need to know of its camera: the faces it looks at, and its rays."""

from __future__ import annotations

from omnisim.cameras import CentralCamera
from omnisim.frames import MIRROR_FROM_OPTICAL
from omnisim.gpu.atlas.tile_plan import TilePlan, plan_tiles
from omnisim.gpu.capture.capture_pass import Capture, Emit, LensCapture, MirrorMeshCapture
from omnisim.mirrors import tessellate
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.stage import Stage

# Of mip levels: half a level finer than a pixel's footprint is worth 1 to 2.5 dB where the pixel
# looks once; where many looks are averaged, a whole level is, and most cameras then need none.
ONE_LOOK_BIAS, MANY_LOOKS_BIAS = -0.5, -1.0


def faces_of(
    sensor: OmniCamera,
    camera: CentralCamera,
    texels_per_pixel: float,
    face_size_px: int | None = None,
    subdivide: bool = False,
) -> TilePlan:
    """The faces that a sensor looks at, with so many texels to a side of its finest pixels.

    Args:
        sensor: which looks.
        camera: its camera, or that of a finer picture.
        texels_per_pixel: of that camera.
        face_size_px: texels across the 90° of every face; None: as the picture needs.
        subdivide: see `plan_tiles`.

    Raises:
        GraphicsError: the camera sees nothing at all.
    """
    past_rim = None
    if sensor.polygons is not None:
        past_rim = (
            tessellate(sensor.model.mirror, sensor.polygons).edge_middles_m @ MIRROR_FROM_OPTICAL
        )
    return plan_tiles(
        camera,
        camera.rig_from_optical,
        texels_per_pixel,
        face_size_px=face_size_px,
        also_seen=past_rim,
        subdivide=subdivide,
        level_bias=ONE_LOOK_BIAS if sensor.supersampling == 1 else MANY_LOOKS_BIAS,
    )


def capture_of(stage: Stage, sensor: OmniCamera, camera: CentralCamera, emit: Emit) -> Capture:
    """The capture of a sensor's rays: its mirror's mesh, or exactly.

    Args:
        stage: where.
        sensor: whose rays.
        camera: its camera, or that of a finer picture.
        emit: what is written for each pixel.
    """
    if sensor.polygons is None:
        return LensCapture(stage.context, camera, emit)
    mesh = tessellate(camera.mirror, sensor.polygons)
    return MirrorMeshCapture(stage.context, camera, mesh, emit)
