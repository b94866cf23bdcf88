"""Sensors that share one copy of a scene: each sees what it sees alone, and nothing piles up."""

import numpy as np
import pytest

from omnisim import OmniCamera, Stage, Vehicle, open_sensor
from omnisim.core.errors import GraphicsError, OmnisimError, SceneError
from omnisim.core.pending import Pending
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.ground_truth.hits import ScanBeams
from omnisim.rendering.instrument import Instrument
from omnisim.rendering.sensor import Moment, Mount, SensorSettings
from omnisim.sensors import DepthCamera, LaserScanner, RangeSensor, SpinningLidar
from tests.scenes import room, scene_of
from tests.vehicles import (
    BASE_FROM_SCANNER,
    CAMERA,
    POSES,
    SCANNER,
    body,
    box,
    surroundings,
)

pytestmark = pytest.mark.usefixtures("needs_opengl", "coarse_shadows")


def test_shared_stage_renders_as_separate_ones():
    """Cameras of different size and light, scanners, by turns; another stage beside them."""
    scene = surroundings()
    small = OmniCamera(polygons=64).resized(90)
    bases = list(POSES.values())[1:3]
    with open_sensor(scene, CAMERA, body=body()) as renderer:
        large_alone = [renderer.render(base).rgba for base in bases]
    with open_sensor(scene, small, body=body(), unlit=True) as renderer:
        small_alone = [renderer.render(base).rgba for base in bases]
    mount = {"base_from_sensor": BASE_FROM_SCANNER}
    with open_sensor(scene, SCANNER, body=body(), **mount) as scanner:
        scans_alone = [scanner.scan(base).ranges_m for base in bases]
    with Stage(scene, body()) as stage, open_sensor(scene_of([room()])) as stranger:
        large_one = stage.open(CAMERA)
        small_one = stage.open(small, unlit=True)
        scanner = stage.open(SCANNER, **mount)
        for index, base in enumerate(bases):
            np.testing.assert_array_equal(large_one.render(base).rgba, large_alone[index])
            stranger.render(np.eye(4))
            np.testing.assert_array_equal(small_one.render(base).rgba, small_alone[index])
            scan = scanner.scan(base)
            np.testing.assert_array_equal(scan.ranges_m, scans_alone[index])
        small_one.close()
        scanner.close()
        with pytest.raises(GraphicsError, match="this GPU takes at most"):
            stage.open(CAMERA.resized(30000))  # leaves the stage unchanged
        np.testing.assert_array_equal(large_one.render(bases[0]).rgba, large_alone[0])
        with stage.current():
            assert stage.context.error == "GL_NO_ERROR"


def test_closing_in_any_order():
    scene = scene_of([room()])
    stage = Stage(scene)
    camera, scanner = stage.open(CAMERA), stage.open(SCANNER)
    camera.render(np.eye(4))
    stage.close()
    stage.close()
    uses = (camera.render, scanner.scan, lambda _: camera.faces(), lambda _: stage.open())
    for use in uses:
        with pytest.raises(GraphicsError, match="this stage is closed: open a new one"):
            use(np.eye(4))
    camera.close()
    with pytest.raises(GraphicsError, match="this renderer is closed"):
        camera.faces()
    with pytest.raises(GraphicsError, match="this renderer is closed: open a new one"):
        camera.render(np.eye(4))
    scanner.close()
    scanner.close()


def test_invalid_arguments_are_refused():
    scene = scene_of([room()])
    with pytest.raises(SceneError, match="'hul': no part of the body: it has box, cage, hull"):
        open_sensor(scene, body=body(), hidden={"hul"})
    with pytest.raises(SceneError, match="hidden: 'lms200': no part of the body: there is no body"):
        open_sensor(scene, LaserScanner(), hidden={"lms200"})
    with Stage(scene, body()) as stage:
        with pytest.raises(SceneError, match="'object 0': no part of the body"):
            stage.open(CAMERA, hidden={"object 0"})  # of the scene
        scanner = stage.open(LaserScanner())
        with pytest.raises(SceneError, match="state: expected a pose of body, got crate"):
            scanner.scan(WorldState({"crate": np.eye(4)}))
        with pytest.raises(OmnisimError, match="expected a rotation and a translation"):
            scanner.scan(2.0 * np.eye(4))
        scanner.scan(np.eye(4))
    with pytest.raises(SceneError, match="expected either the body of one vehicle or vehicles"):
        Stage(scene, body(), vehicles={"other": body()})
    with pytest.raises(SceneError, match="dynamic object 'one': expected each name once"):
        Stage(scene, vehicles={"one": body()}, dynamic_objects={"one": body()})
    with pytest.raises(GraphicsError, match="there is no such device"):
        Stage(scene, device=99)


class _Plumb(SensorSettings):
    """Sensor of a user: the height over the ground."""

    def summary(self):
        return "plumb line"

    def open(self, stage, mount):
        return _PlumbInstrument(stage, self, mount)


class _PlumbInstrument(Instrument):
    def _open_passes(self, hidden):
        return self._stage.backend.range_finder(ScanBeams(np.zeros(1), np.inf), hidden)

    def begin(self, moment):
        now = self._state(moment.motion(moment.time_s))
        down = self._world_from_sensor(now) @ pose(pitch_deg=90.0)
        with self._current() as passes:
            return Pending.done(float(passes.cast(down, self._stage.poses_in(now))[0]))


def test_a_stage_opens_sensors_of_a_users_own():
    floor = scene_of([box("floor", 0)])
    top_m = floor.bounds_m()[1, 2]
    with open_sensor(floor, _Plumb(), pose((0.0, 0.0, 0.5)), backend="rays") as renderer:
        height_m = renderer.measure(pose((0.0, 0.0, top_m + 1.0)))
        assert height_m == pytest.approx(1.5, abs=1e-6)
        assert "plumb line" in repr(renderer)
    with pytest.raises(GraphicsError, match="this renderer is closed"):
        renderer.measure(pose())


def test_sensors_are_opened_as_they_are_mounted():
    robot, mount = Vehicle.load("p2at"), pose((0.1, 0.2, 0.3), yaw_deg=40.0)
    laser = robot.scanner()
    with Stage(scene_of([room()]), robot.body, backend="rays") as stage:
        mounted, given = (
            stage.open(laser),
            stage.open(laser.sensor, laser.base_from_sensor, hidden=laser.hides),
        )
        scan = mounted.scan(pose())
        np.testing.assert_array_equal(scan.ranges_m, given.scan(pose()).ranges_m)
        np.testing.assert_array_equal(scan.world_from_scanner, laser.base_from_sensor)
        eye = robot.camera()
        assert stage.open(eye).camera.base_from_rig is eye.sensor.base_from_rig
        # a camera's own mount comes after the one it is opened on
        camera = stage.open(CAMERA, mount).camera
        np.testing.assert_array_equal(camera.base_from_rig, mount @ CAMERA.base_from_rig)
        with pytest.raises(OmnisimError, match="expected a rotation and a translation"):
            stage.open(CAMERA, 2.0 * np.eye(4))


def test_every_instrument_measures_at_moments_and_its_readings_save_themselves(tmp_path):
    here, stem = pose((0.1, 0.2, 0.5), yaw_deg=20.0), tmp_path / "000003"
    moment = Moment(lambda time_s: pose((0.1 * time_s, 0.2, 0.5), yaw_deg=20.0), 3, 1.0)
    depth = DepthCamera(width_px=16, height_px=12, focal_length_px=12.0)
    lidar = SpinningLidar(firings=60, rate_hz=1000.0, file_format="pcd")
    with Stage(scene_of([room()]), backend="rays") as stage:
        scanner = stage.open(LaserScanner())
        scan = scanner.measure(moment)
        np.testing.assert_array_equal(scan.ranges_m, scanner.scan(here, 3).ranges_m)
        np.testing.assert_array_equal(scan.ranges_m, scanner.measure(here, 3).ranges_m)
        for sensor in (LaserScanner(), depth, RangeSensor(), lidar, CAMERA.resized(24)):
            with stage.open(Mount(sensor, "any")) as instrument:
                reading = instrument.measure(moment)
                assert reading.metadata["scene"] == stage.scene.name
                reading.save(stem)
                files = list(tmp_path.iterdir())
                assert {file.suffix for file in files} <= set(sensor.suffixes)
                assert [file.stem for file in files] == ["000003"]
                files[0].unlink()
