"""Objects of the library as a person meets them: in a prompt and in a notebook."""

import dataclasses
import pydoc
import subprocess
import sys

import numpy as np
import pytest

import omnisim
from omnisim.cameras import EquidistantCamera, PerspectiveCamera, RadialTableCamera
from omnisim.cameras.calibration.ray_table import ray_table
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.mirror_mesh import tessellate
from omnisim.core.errors import CalibrationError, OpticsError, SceneError
from omnisim.core.files.image_files import read_image
from omnisim.core.package_files import SCENES
from omnisim.core.trajectories.odometry import OdometryErrors, simulate_odometry
from omnisim.core.trajectories.trajectory import Trajectory
from omnisim.ground_truth.frame import Frame
from omnisim.ground_truth.label_names import ClassLabel, InstanceLabel, Labels
from omnisim.perception.localization.track import Track
from omnisim.rendering.camera.degradations.degradation_file import preset
from omnisim.robots import load_robot
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.runs.run_folder import RunFolder
from omnisim.runs.run_manifest import Manifest
from omnisim.scene.model import LabelRule
from tests.camera_examples import CAMERA_EXAMPLES, FIRST_EXAMPLES
from tests.scenes import scene_of

LENS = EquidistantCamera(64, 64, 20.0, (31.5, 31.5), 1.6)
LABELS = Labels((ClassLabel(1, "wall", (200, 0, 0)),), (InstanceLabel(1, "wall_1", 1),), "table")


def _frame(long_name="courtyard"):
    ids = np.ones((4, 6), np.uint16)
    channels = {"range": np.ones((4, 6), np.float32), "semantic": ids, "instance": ids}
    metadata = {"scene": long_name, "camera": LENS.parameters()}
    rgba = np.full((4, 6, 4), 255, np.uint8)
    return Frame(rgba, np.zeros((4, 6, 3), np.float32), metadata, channels, LABELS)


def _objects():
    scene, vehicle = omnisim.load_scene("soccer"), omnisim.Vehicle.load("p2at")
    times = np.arange(1000.0)
    trajectory = Trajectory.on_ground(times, np.column_stack((times, times)), 0.0 * times)
    sensor = omnisim.OmniCamera().with_degradation(preset("bad-day"))
    frame = _frame("a folder of a very long name/" * 20)
    drive = Drive(scene, vehicle, Route("lap"))
    manifest = Manifest.model_validate(
        {
            "format": 2,
            "scene": {"name": "soccer", "file": "soccer", "up_axis": None, "contents": ""},
            "robot": {"name": "p2at"},
            "path": {"name": "lap"},
            "steps": 300,
            "sensors": {f"camera {index}": {"type": "omnicamera"} for index in range(40)},
        }
    )
    many = tuple(omnisim.calibration_of(LENS, f"cam{at}").camera() for at in range(50))
    yield from (CAMERA_EXAMPLES[name] for name in FIRST_EXAMPLES)
    yield from (scene, scene.lighting, *scene.lighting.lights, *scene.landmarks, *scene.paths)
    yield from (*scene.meshes[:3], *scene.instances[:3], *scene.materials[:3], *scene.starts)
    yield LabelRule(1, "wall", (0, 0, 0), tuple(f"wall_{index}*" for index in range(100)))
    yield from (sensor, sensor.degradation, omnisim.OmniCamera.of(LENS), omnisim.Degradation())
    yield from (omnisim.calibration_of(sensor), many[0], omnisim.Calibration(many))
    yield from (frame, frame.channels, LABELS, trajectory, drive, load_robot("p2at"))
    yield from (vehicle, *vehicle.sensors, omnisim.LaserScanner())
    yield from (omnisim.Twist(), omnisim.WorldState({"body": np.eye(4)}))
    yield simulate_odometry(trajectory, OdometryErrors(), 0)
    yield RunFolder(SCENES, manifest)
    yield RadialTableCamera(
        64, 64, (31.5, 31.5), tuple(np.linspace(0.0, 1.5, 64)), tuple(np.linspace(0.0, 31.0, 64))
    )
    yield from (ray_table(LENS), tessellate(HyperbolicMirror(), 1024), Track((), np.zeros((0, 3))))
    yield omnisim.Scan(
        omnisim.LaserScanner().angles_deg, np.ones(361), omnisim.LaserScanner(), np.eye(4)
    )


def _check(shown):
    text = repr(shown)
    assert len(text) < 200, f"{type(shown).__name__}: {len(text)} characters"
    assert "\n" not in text
    assert text.startswith(type(shown).__name__)


def test_representations_are_short():
    kinds = set()
    for shown in _objects():
        _check(shown)
        kinds.add(type(shown))
    with_gpu = {omnisim.Stage, omnisim.Renderer, omnisim.LaserRenderer}
    public = {
        shown for name in omnisim.__all__ if isinstance(shown := getattr(omnisim, name), type)
    }
    assert public - kinds == with_gpu | {omnisim.OmnisimError, omnisim.NoticeWarning}
    assert repr(omnisim.load_scene("soccer")) == (
        "Scene('soccer', 237 instances, 30,835 triangles, baked light, 6 landmarks, 7 starts, "
        "2 paths)"
    )


@pytest.mark.usefixtures("needs_opengl")
def test_renderers_take_names_files_and_lenses(tmp_path):
    (tmp_path / "my.toml").write_text("[camera]\nwidth_px = 24\nheight_px = 24\n")
    with omnisim.open_sensor("rings", str(tmp_path / "my.toml")) as renderer:
        assert renderer.camera.model.width_px == 24
        frame = renderer.render(omnisim.pose((0.0, 0.0, 1.0)), also=("range",))
        _check(renderer)
        _check(frame)
    _check(renderer)
    scene = omnisim.load_scene("rings")
    with omnisim.Stage(scene) as stage, stage.open(LENS) as renderer:
        assert renderer.camera.mesh_polygons is None
        assert renderer.camera.model is LENS
        with stage.open(omnisim.LaserScanner()) as scanner:
            for shown in (stage, renderer, scanner, scanner.scan(np.eye(4))):
                _check(shown)


def test_calibrations_are_cameras_of_renderers(tmp_path):
    path = tmp_path / "one.json"
    lens = PerspectiveCamera(24, 20, 15.0, (11.5, 9.5))
    calibration = omnisim.calibration_of(lens)
    calibration.save(path, "omnisim")
    assert omnisim.calibration_of(omnisim.OmniCamera.of(lens)).camera().camera is lens
    for camera in (path, str(path), calibration, calibration.camera()):
        sensor = omnisim.OmniCamera.of(camera)
        assert sensor.model == lens
        assert sensor.polygons is None
    two = omnisim.Calibration((*calibration.cameras, omnisim.calibration_of(LENS, "b").camera()))
    with pytest.raises(CalibrationError, match=r"expected one camera, got cam0, b: select one"):
        omnisim.OmniCamera.of(two)
    with pytest.raises(CalibrationError, match=r"none\.yaml: cannot be read"):
        omnisim.OmniCamera.of("none.yaml")


def test_other_types_say_what_was_expected():
    for make in (omnisim.OmniCamera, omnisim.OmniCamera.of):
        with pytest.raises(OpticsError, match="expected a camera model, got int"):
            make(360)
    with pytest.raises(SceneError, match="expected a path or a name, got int"):
        omnisim.load_scene(360)
    with pytest.raises(CalibrationError, match="expected a camera model or a sensor, got str"):
        omnisim.calibration_of("my.toml")


def test_notebooks_show_a_frame_and_its_channels(tmp_path):
    frame = _frame()
    path = tmp_path / "frame.png"
    path.write_bytes(frame._repr_png_())
    pixels, _ = read_image(path)
    np.testing.assert_array_equal(pixels, frame.rgb)
    html = frame.channels._repr_html_()
    assert html.count("data:image/png;base64,") == 3
    assert "<figcaption>range, m</figcaption>" in html


def test_a_frame_is_shown_without_matplotlib():
    code = (
        "import sys, omnisim, numpy as np\n"
        "frame = omnisim.Frame(np.zeros((2, 2, 4), np.uint8), None, {},"
        " {'range': np.ones((2, 2), np.float32)})\n"
        "frame._repr_png_(), frame.channels._repr_html_()\n"
        "assert 'matplotlib' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_package_lists_its_public_names():
    assert dir(omnisim) == sorted(omnisim.__all__)
    for name in set(omnisim.__all__) - {"__version__"}:
        assert f"`{name}`" in omnisim.__doc__


def test_the_package_runs_as_the_command():
    arguments = [sys.executable, "-m", "omnisim", "--version"]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert done.stdout == f"omnisim {omnisim.__version__}\n"


def test_help_of_a_camera_has_its_own_words_alone():
    text = pydoc.render_doc(omnisim.cameras.HyperbolicCamera, renderer=pydoc.plaintext)
    assert "rig_from_optical" in text
    assert "ndarray(shape" not in text


def test_notices_of_a_scene_are_warnings_of_the_caller(monkeypatch):
    noted = dataclasses.replace(scene_of([], []), notices=("a.glb: no fur", "a.glb: no hair"))
    monkeypatch.setattr("omnisim.scene.files.load.read_scene", lambda *given: noted)
    with pytest.warns(omnisim.NoticeWarning) as caught:
        assert omnisim.load_scene("a.glb") is noted
    assert tuple(str(one.message) for one in caught) == noted.notices
    assert {one.filename for one in caught} == {__file__}
