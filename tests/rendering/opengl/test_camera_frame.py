"""Every camera model in a room whose colors are computed without any renderer."""

import numpy as np

from omnisim.cameras import pixel_grid
from omnisim.core import poses
from omnisim.core.cube import face_index
from omnisim.core.srgb import srgb_from_linear
from omnisim.rendering.atlas.tile_plan import plan_tiles
from omnisim.rendering.contract import ScenePoses, SubFrame, SubFrames
from omnisim.rendering.opengl.camera_frame import CameraFrame, CubePass
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from omnisim.rendering.opengl.scene_view import VirtualCameras
from omnisim.rendering.opengl.surfaces.surface_program import SurfacePrograms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from tests.camera_examples import camera_examples
from tests.scenes import ROOM_HALF_M, next_to_another_face, room, room_color, room_hit, scene_of

POSE = poses.pose((0.3, -0.4, 0.1), roll_deg=12.0, pitch_deg=-20.0, yaw_deg=33.0)
FRAMES = SubFrames((SubFrame(ScenePoses(POSE)),))


def _render(context, camera):
    scene = scene_of([room()])
    buffers = SceneBuffers(context, scene)
    plan = plan_tiles(camera, camera.rig_from_optical, subdivide=True)
    cube = CubePass(
        buffers,
        SurfacePrograms(buffers, scene.lighting),
        plan,
        VirtualCameras(near_m=0.05, far_m=np.inf, unlit=True),
    )
    return CameraFrame(cube, PixelMap(context, camera)).begin(FRAMES).result().rgba


@camera_examples
def test_room_has_the_right_color_everywhere(context, camera):
    camera = camera.scaled(min(1.0, 260 / camera.width_px))
    rgba = _render(context, camera)
    pixels = pixel_grid(camera.width_px, camera.height_px)
    rays = camera.ray_from_pixel(pixels)
    rig = rays.directions @ camera.rig_from_optical.T
    hits = room_hit(POSE[:3, 3], rig @ POSE[:3, :3].T)
    expected = 255.0 * srgb_from_linear(room_color(hits))
    # Where the domain ends near by, there is nothing to compare with half a pixel further on.
    width_rad = np.zeros(rays.valid.shape)
    inside = rays.valid.copy()
    for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        beside = camera.ray_from_pixel(pixels + step)
        inside &= beside.valid
        angle = np.linalg.norm(beside.directions - rays.directions, axis=-1)
        width_rad = np.maximum(width_rad, angle)
    # The room is smooth but for its own edges, where any filter rounds the crease off a little.
    crease_m = np.sort(np.abs(np.abs(hits) - ROOM_HALF_M), axis=-1)[..., 1]
    distance_m = np.linalg.norm(hits - POSE[:3, 3], axis=-1)
    smooth = inside & (crease_m / distance_m > 3.0 * width_rad)
    assert smooth.sum() > 0.6 * inside.sum()
    off = np.abs(rgba[..., :3] - expected).max(axis=-1)
    assert off[smooth].max() <= 2.0
    seam = smooth & next_to_another_face(face_index(rig))
    if seam.any():
        assert off[seam].mean() < 1.0
