"""Keys of sensors for glass and mirrors, and notices on what beams leave out."""

import numpy as np
import pytest

from omnisim.core.errors import RobotFileError
from omnisim.core.extras import EXTRAS
from omnisim.rendering.reflection_kinds import specular_notes
from omnisim.robots.vehicle import Vehicle
from omnisim.scene.model import Lighting, Material
from omnisim.sensors import DepthCamera, LaserScanner, SpinningLidar
from omnisim.sensors.device_data import stated_parameters
from omnisim.validation.material_chart import sphere
from tests.scenes import scene_of, square

METAL = Material(metallic=1.0, roughness=0.0)
ROBOT = """
name = "scout"

[kinematics]
type = "differential"
track_m = 0.4
wheel_diameter_m = 0.2
max_speed_mps = 1.0
max_turn_rate_degps = 90.0
max_acceleration_mps2 = 0.5
max_turn_acceleration_degps2 = 180.0

[[sensors]]
name = "sensor"
position_m = [0.1, 0.0, 0.6]
"""


def sensor_of(folder, keys):
    (folder / "robot.toml").write_text(ROBOT + keys, encoding="utf-8")
    return Vehicle.load(folder / "robot.toml").sensors[0].sensor


@pytest.mark.parametrize("kind", ["lidar", "lms200", "usarsim_range_scanner", "depth_camera"])
def test_a_key_ends_beams_at_glass_and_mirrors(tmp_path, kind):
    assert sensor_of(tmp_path, f'type = "{kind}"').specular
    assert not sensor_of(tmp_path, f'type = "{kind}"\nspecular = false').specular
    with pytest.raises(RobotFileError, match=r"robot.toml: .*specular: expected true or false"):
        sensor_of(tmp_path, f'type = "{kind}"\nspecular = 1')


def test_a_lidar_has_up_to_two_returns(tmp_path):
    lidar = sensor_of(tmp_path, 'type = "lidar"\nreturns = 2\nmin_intensity = 0.3')
    assert (lidar.returns, lidar.min_intensity) == (2, 0.3)
    with pytest.raises(RobotFileError, match=r"robot.toml: .*returns: expected .*2, got 3"):
        sensor_of(tmp_path, 'type = "lidar"\nreturns = 3')


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
    from omnisim.rendering.stage import open_sensor

    monkeypatch.setitem(EXTRAS, "rays", {"embreex": "no_such_module"})
    scene = scene_of([square(half_m=50.0), square(half_m=50.0, z_m=5.0, material=1)], [
        METAL, Material(double_sided=True)
    ])  # fmt: skip
    lidar = SpinningLidar(
        elevations_deg=(-30.0,), firings=16, sigma_m=0.0, step_m=0.0, range_min_m=0.0
    )
    above = np.eye(4)
    above[2, 3] = 1.0
    with open_sensor(scene, lidar) as renderer:
        points = renderer.scan(above).points
    assert points["intensity"].max() < 1e-6  # a polished surface that is met at a slant
    np.testing.assert_allclose(points["range"], 2.0, atol=1e-4)
