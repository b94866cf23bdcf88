"""Keys of sensors for glass and mirrors, and notices on what beams leave out."""

import numpy as np
import pytest

from omnisim.core.extras import EXTRAS
from omnisim.core.poses import pose
from omnisim.rendering.reflection_kinds import specular_notes
from omnisim.rendering.stage import open_sensor
from omnisim.robots import parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.scene.model import Lighting, Material
from omnisim.sensors import DepthCamera, LaserScanner, SpinningLidar
from omnisim.sensors.device_data import stated_parameters
from omnisim.validation.material_chart import sphere
from tests.scenes import scene_of, square

METAL = Material(metallic=1.0, roughness=0.0)


def test_a_key_ends_beams_at_glass_and_mirrors():
    for kind in ("lidar", "lms200", "usarsim_range_scanner", "depth_camera"):
        table = {"name": "s", "type": kind, "position_m": (0.0, 0.0, 0.6)}
        robot = {"name": "a", "sensors": [table, table | {"name": "t", "specular": False}]}
        mounts = Vehicle.from_robot(parse_robot(robot, "robot")).sensors
        assert [mount.sensor.specular for mount in mounts] == [True, False]


def test_headers_state_what_differs_from_the_defaults():
    for sensor in (SpinningLidar(), LaserScanner()):
        assert not {"specular", "returns", "min_intensity"} & stated_parameters(sensor).keys()
    stated = stated_parameters(SpinningLidar(returns=2, specular=False))
    assert (stated["returns"], stated["specular"]) == (2, False)
    assert DepthCamera().specular


def test_notices_name_curved_mirrors_and_the_missing_extra(monkeypatch):
    pytest.importorskip("embreex", reason="embreex, which casts the beams, is missing")
    flat = scene_of([square()], [METAL])
    curved = scene_of([square(), sphere(1.0, 8)], [METAL])
    plain = scene_of([square()], [Material()])
    matte = scene_of([square()], [METAL], None, Lighting((1.0, 1.0, 1.0), (), is_matte=True))
    assert specular_notes(flat, [], "cube") == specular_notes(flat, [], "rays") == []
    assert specular_notes(curved, [], "rays") == [
        "beams return nothing from behind curved mirrors (1 material)"
    ]
    monkeypatch.setitem(EXTRAS, "rays", {"embreex": "no_such_module"})
    for scene, objects in ((flat, []), (plain, [flat])):
        (note,) = specular_notes(scene, objects, "cube")
        assert note.startswith("beams and depths end at glass and mirrors: pip install")
    assert specular_notes(plain, [], "cube") == specular_notes(matte, [], "cube") == []


@pytest.mark.usefixtures("needs_opengl")
def test_without_embreex_beams_end_at_glass(monkeypatch):
    monkeypatch.setitem(EXTRAS, "rays", {"embreex": "no_such_module"})
    meshes = [square(half_m=50.0), square(half_m=50.0, z_m=5.0, material=1)]
    scene = scene_of(meshes, [METAL, Material(double_sided=True)])
    exact = SpinningLidar(elevations_deg=(-30.0,), firings=16, range_min_m=0.0).without_errors()
    with open_sensor(scene, exact) as renderer:
        points = renderer.scan(pose((0.0, 0.0, 1.0))).points
    assert points["intensity"].max() < 1e-6  # a polished surface that is met at a slant
    np.testing.assert_allclose(points["range"], 2.0, atol=1e-4)
