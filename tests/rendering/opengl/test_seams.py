"""The exact capture against colors computed without any renderer."""

import math

import numpy as np
import pytest

from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core import poses
from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.cube import face_index
from omnisim.core.srgb import srgb_from_linear
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from tests.scenes import ROOM_HALF_M, next_to_another_face, room, room_color, room_hit, scene_of

pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.mark.parametrize(
    ("theta_max_deg", "face_size_px"), [(105.0, None), (150.0, 128), (150.0, 512)]
)
def test_no_seam_and_the_right_color_everywhere(theta_max_deg, face_size_px):
    pose = poses.pose((-1.0, 0.7, -0.5), roll_deg=12.0, pitch_deg=-20.0, yaw_deg=33.0)
    mirror = HyperbolicMirror(theta_max_rad=math.radians(theta_max_deg))
    camera = HyperbolicCamera.framed_on_rim(mirror, 360, 360)
    sensor = OmniCamera(model=camera, polygons=None, face_size_px=face_size_px)
    with open_sensor(scene_of([room()]), sensor) as renderer:
        frame = renderer.render(pose)
    rays = camera.ray_from_pixel(pixel_grid(360, 360))
    valid, rig = rays.valid, rays.directions @ RIG_FROM_OPTICAL_LOOKING_UP.T
    hits = room_hit(pose[:3, 3], rig @ pose[:3, :3].T)
    expected = 255.0 * srgb_from_linear(room_color(hits))
    # a pixel counts where the mirror covers half of its four samples, which are ¼ px from its
    # middle: those whose middle is up to that far outside may count, too
    radii = np.linalg.norm(pixel_grid(360, 360) - camera.principal_point_px, axis=-1)
    assert np.all(frame.valid[valid])
    assert not np.any(frame.valid[radii > camera.rim_radius_px + 0.25])
    off = np.abs(frame.rgb - expected).max(axis=-1)
    # The room is smooth but for its own edges, where any filter rounds the crease off a little:
    # leave out what is within three pixels of one. A pixel is at most 1/h radians wide where the
    # room's edges are; the second nearest wall is at the edge.
    crease_m = np.sort(np.abs(np.abs(hits) - ROOM_HALF_M), axis=-1)[..., 1]
    distance_m = np.linalg.norm(hits - pose[:3, 3], axis=-1)
    smooth = valid & (crease_m / distance_m > 3.0 / camera.horizon_radius_px)
    assert smooth.sum() > 0.7 * valid.sum()
    assert off[smooth].max() <= 2.0
    # And across an edge of the cube it is no worse than inside a face.
    seam = smooth & next_to_another_face(face_index(rig))
    assert seam.sum() > 500
    assert off[seam].max() <= 2.0
    assert off[seam].mean() < 1.0
