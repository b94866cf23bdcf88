"""The light of the shader against its NumPy twin, at every pixel of a floor."""

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene.light.lighting import illuminance
from omnisim.scene.model import Light, Lighting, LightKind, Material
from tests.scenes import scene_of, square

VIEWPOINT_M = np.array([0.7, -0.4, 1.3])
AMBIENT, EXPOSURE = 0.05, 0.2
SLANTED = np.array([0.48, 0.36, -0.8])


def _light(kind, **options):
    options.setdefault("position_m", np.array([-0.6, 0.5, 1.1]))
    return Light(kind, (1.0, 1.0, 1.0), 2.0, direction=SLANTED, **options)


LIGHTS = {
    "directional": _light(LightKind.DIRECTIONAL),
    "point": _light(LightKind.POINT),
    "point-with-range": _light(LightKind.POINT, range_m=2.5),
    "spot": _light(LightKind.SPOT, cone_cosines=(0.95, 0.6)),
    "spot-with-range": _light(LightKind.SPOT, cone_cosines=(0.95, 0.6), range_m=2.0),
}
POSES = {
    "level": np.eye(4),
    # scaled unlike along its axes, slanted, and once mirrored: normals are not just turned
    "slanted": np.array([[2, 0, 0, 0], [0, 1, 0, 0], [0.6, -0.3, 0.5, 0], [0, 0, 0, 1.0]]),
    "mirrored": np.array([[-2, 0, 0, 0], [0, 1, 0, 0], [-0.6, -0.3, 0.5, 0], [0, 0, 0, 1.0]]),
}


def _floor(normals):
    # not across the floor: a shader that uses the triangle's own normal instead is found out
    leaning = np.tile(np.array([[0.3, 0.2, 0.9]], np.float32), (4, 1)) if normals else None
    return square(9.0, normals=leaning)


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(
    ("name", "normals", "sides"),  # of one side light may be known before it is drawn
    [("level", False, 1), ("slanted", True, 2), ("mirrored", True, 1), ("mirrored", False, 2)],
)
@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS.keys())
def test_light_on_a_floor(light, name, normals, sides):
    pose = POSES[name]
    lighting = Lighting((AMBIENT,) * 3, (light,), EXPOSURE)
    scene = scene_of([_floor(normals)], [Material(double_sided=sides == 2)], [pose], lighting)
    sensor = OmniCamera(polygons=None, face_size_px=256, samples=1).resized(91)
    with open_sensor(scene, sensor) as renderer:
        shown = renderer.render(sensor.base_pose(VIEWPOINT_M), linear=True).linear

    def in_world(normal):  # a normal is carried by the inverse transpose
        carried = np.linalg.inv(pose[:3, :3]).T @ normal
        return carried / np.linalg.norm(carried)

    plane = in_world((0.0, 0.0, 1.0))
    shading = in_world((0.3, 0.2, 0.9)) if normals else plane
    rays = sensor.model.ray_from_pixel(pixel_grid(91, 91))
    directions = rays.directions @ RIG_FROM_OPTICAL_LOOKING_UP.T
    near = rays.valid & (directions[..., 2] < -0.75)  # steeply down: all on the floor
    directions = directions[near]
    hits = VIEWPOINT_M - directions * ((VIEWPOINT_M @ plane) / (directions @ plane))[:, None]
    # the twin counts light from both sides, the shader from the side that is seen
    seen_side = np.sign((VIEWPOINT_M - hits) @ plane)[:, None] * shading
    travel = SLANTED if light.kind is LightKind.DIRECTIONAL else hits - light.position_m
    from_front = np.sum(seen_side * travel, axis=1) < 0.0
    lit = np.where(from_front, illuminance(light, hits, np.broadcast_to(shading, hits.shape)), 0)
    assert from_front.mean() > 0.5
    # half floats, and a filter over a texel where the light changes fast
    np.testing.assert_allclose(shown[near][:, 0], AMBIENT + EXPOSURE * lit, rtol=0.02, atol=0.004)
