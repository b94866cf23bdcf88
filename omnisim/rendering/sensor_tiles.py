"""Tiles of the atlas that a sensor needs."""

from __future__ import annotations

from omnisim.cameras import CentralCamera, HyperbolicCamera
from omnisim.cameras.mirrors import tessellate
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan, plan_tiles

# Mip level bias: at 1 sample per pixel, sampling half a level finer than the pixel's footprint
# gains 1 to 2.5 dB; with more samples, which are averaged, a whole level does, and most cameras
# then need no mip levels.
ONE_SAMPLE_BIAS, SUPERSAMPLED_BIAS = -0.5, -1.0


def sensor_tiles(
    sensor: OmniCamera,
    camera: CentralCamera,
    texels_per_pixel: float,
    face_size_px: int | None = None,
    subdivide: bool = False,
) -> TilePlan:
    """Plan the tiles of a sensor.

    Args:
        camera: its camera model, or that of its supersampled image.
        texels_per_pixel: texels per side of that camera's smallest pixels.
        face_size_px: texels across the 90° of every face; None: as the image requires.
        subdivide: see `plan_tiles`.

    Raises:
        GraphicsError: the camera sees nothing.
    """
    past_rim = None
    if sensor.mesh_polygons is not None and isinstance(camera, HyperbolicCamera):
        mesh = tessellate(camera.mirror, sensor.mesh_polygons)
        # a fine mesh has many edges; only those on the rim extend past it
        middles_m = mesh.rim_middles_m if sensor.polygons == "auto" else mesh.edge_middles_m
        past_rim = middles_m @ MIRROR_FROM_OPTICAL
    return plan_tiles(
        camera,
        camera.rig_from_optical,
        texels_per_pixel,
        face_size_px=face_size_px,
        also_seen=past_rim,
        subdivide=subdivide,
        level_bias=ONE_SAMPLE_BIAS if sensor.supersampling == 1 else SUPERSAMPLED_BIAS,
    )
