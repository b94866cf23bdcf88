"""What a sensor's passes need to know of its camera: the faces it looks at, and its rays."""

from __future__ import annotations

from omnisim.cameras import CentralCamera
from omnisim.frames import MIRROR_FROM_OPTICAL
from omnisim.gpu.capture_pass import Capture, Emit, LensCapture, MirrorMeshCapture
from omnisim.gpu.face_plan import FacePlan, plan_faces
from omnisim.mirrors import tessellate
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.stage import Stage


def faces_of(
    sensor: OmniCamera, texels_per_pixel: float, face_size_px: int | None = None
) -> FacePlan:
    """The faces that a sensor looks at, with so many texels to a side of its finest pixels.

    Raises:
        GraphicsError: the camera sees nothing at all.
    """
    camera = sensor.camera
    past_rim = None
    if sensor.polygons is not None:
        past_rim = tessellate(camera.mirror, sensor.polygons).edge_middles_m @ MIRROR_FROM_OPTICAL
    planned = camera.scaled(texels_per_pixel)
    return plan_faces(planned, camera.rig_from_optical, face_size_px, past_rim)


def capture_of(
    stage: Stage, sensor: OmniCamera, camera: CentralCamera, emit: Emit = Emit.COLOR
) -> Capture:
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
