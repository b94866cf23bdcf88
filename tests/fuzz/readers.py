"""Readers of files, each with a sample: what the fuzzer damages and reads."""

import dataclasses
import json
import math
import re
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
import trimesh

from omnisim import OmniCamera
from omnisim.cameras.calibration import load_calibration
from omnisim.cameras.calibration.ray_table import read_ray_table, write_ray_table
from omnisim.cameras.optics import read_corners, read_optics_file
from omnisim.core.errors import OpticsError
from omnisim.core.extras import is_installed
from omnisim.core.files.image_files import read_channels, write_image
from omnisim.core.package_files import PRESETS, SCENES
from omnisim.core.poses import pose
from omnisim.core.trajectories import write_trajectory
from omnisim.core.trajectories.body_motion import SplineMotion
from omnisim.core.trajectories.trajectory_files import FORMATS
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.recording import read_cloud, read_table
from omnisim.ground_truth import ClassLabel, InstanceLabel, Labels
from omnisim.ground_truth.channel_files import StoredChannels, write_exr
from omnisim.ground_truth.channels import CHANNELS
from omnisim.ground_truth.frame import Frame
from omnisim.perception.landmarks.color_model import BINS, ColorModel, load_model, save_model
from omnisim.perception.localization.filter import DEFAULT as FILTER_FILE
from omnisim.perception.localization.filter import read_parameters
from omnisim.perception.unwarping import Unwarping, cylinder_view
from omnisim.rendering.camera.captured_image import read_captured_image
from omnisim.rendering.camera.degradations import preset
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE
from omnisim.robots import read_odometry, simulate_odometry, write_odometry
from omnisim.robots.importers.gazebo_robot import import_model
from omnisim.robots.importers.importers import load_robot_model
from omnisim.robots.importers.usarsim import import_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route, plan_route
from omnisim.runs.run_data import RunLabels, landmark_colors, read_run
from omnisim.runs.run_folder import open_run, read_states, read_times, write_states
from omnisim.runs.run_manifest import read_manifest
from omnisim.scene import read_scene
from omnisim.scene.formats.usd import reader as usd_reader
from omnisim.scene.labels import find_labels, read_label_file
from omnisim.sensors.calibration_file import read_mount
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner, Scan
from omnisim.sensors.lidar.point_files import POINT
from omnisim.sensors.lidar.spinning_lidar import PointCloud, SpinningLidar
from tests.baked import write_baked
from tests.camera_examples import CAMERA_EXAMPLES
from tests.cameras.calibration.sample_files import EXACT_SAMPLES
from tests.fuzz.data_sets import PLAN, read_data_set, read_plan, write_data_set
from tests.fuzz.mutations import glb
from tests.fuzz.usd_sample import write_sample
from tests.robots.importers.usarsim.test_usarsim_robot import SAMPLE as ROBOTS_INI
from tests.scene.compressed_gltf import colored_draco_triangle, compressed_tetrahedron
from tests.scene.formats.mjcf.models import SHAPES
from tests.scene.gltf_builder import png, skinned_and_textured
from tests.vehicles import p2at_with_every_sensor

SIZE_PX = 24
GAZEBO_ROBOT = Path(__file__).parents[2] / "examples" / "gazebo/models/rover/model.sdf"
OPTICS = Path(__file__).parents[2] / "examples" / "optics"
BAKED_FILES = tuple(
    f"a/{name}" for name in ("baked.json", "irradiance.exr", "unwrapping.npz", "probes.npz")
)
LINES = re.compile(r"(?m)^\[\[labels\]\]\n(?:.+\n)*")


@dataclass(frozen=True)
class Reader:
    """Reader of one file, or of a folder of files.

    Attributes:
        name: its own.
        file: name of the file, in a folder of its own; empty: the folder.
        sample: valid text, a file to copy, or a function that writes at a path.
        read_path: reads the file or folder at a path.
        damaged: names of the files that are damaged; empty: all of the sample.
    """

    name: str
    file: str
    sample: str | Path | Callable[[Path], object]
    read_path: Callable[[Path], object]
    damaged: tuple[str, ...] = ()

    def build(self, folder: Path) -> None:
        """Write the sample into an empty folder."""
        path = folder / self.file
        if isinstance(self.sample, str):
            path.write_text(self.sample)
        elif isinstance(self.sample, Path):
            shutil.copyfile(self.sample, path)
        else:
            self.sample(path)

    def read(self, folder: Path) -> None:
        """Read the sample in a folder."""
        self.read_path(folder / self.file)


def _box_obj(path: Path) -> None:
    box = trimesh.creation.box(extents=(20.0, 3.0, 20.0))
    corners = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in box.vertices)
    faces = "".join(f"f {a}/1/1 {b}/2/1 {c}/3/1\n" for a, b, c in box.faces + 1)
    text = f"mtllib box.mtl\no box\n{corners}vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nusemtl wood\n{faces}"
    path.write_text(text)
    path.with_name("box.mtl").write_text(
        "newmtl wood\nKd 0.8 0.4 0.2\nd 0.5\nmap_Kd -s 2 2 1 wood.png\nmap_d wood.png\n"
    )
    path.with_name("wood.png").write_bytes(png(np.arange(48).reshape(4, 4, 3)))


def _gltf_json(path: Path) -> None:
    tree, blob = skinned_and_textured()
    tree["buffers"][0]["uri"] = "box.bin"
    path.with_suffix(".bin").write_bytes(blob)
    path.write_text(json.dumps(tree))


def _mesh(path: Path, **options: object) -> None:
    """Box by trimesh, with the colors that the format has."""
    box = trimesh.creation.box(extents=(1.0, 2.0, 3.0))
    if path.suffix == ".ply":
        box.visual.vertex_colors = np.tile([[200, 100, 50, 255]], (8, 1))
    data = box.export(**{"file_type": path.suffix[1:], **options})
    if path.suffix == ".dae":  # without the time of writing, and names that chance gives
        data = re.sub(rb"(?s)<(created|modified)>.*?</\1>", b"", data)
        for number, found in enumerate(dict.fromkeys(re.findall(rb"[0-9a-f]{32}", data))):
            data = data.replace(found, b"id%d" % number)
    path.write_bytes(data if isinstance(data, bytes) else data.encode())


def _collada_submesh(path: Path) -> None:
    """World of Gazebo with a submesh by its node's name."""
    _mesh(path.with_suffix(".dae"))
    mesh = "<mesh><uri>a.dae</uri><submesh><name>node0</name><center>1</center></submesh></mesh>"
    visual = f'<visual name="v"><geometry>{mesh}</geometry></visual>'
    model = f'<model name="m"><link name="l">{visual}</link></model>'
    path.write_text(f'<sdf version="1.9"><world name="w">{model}</world></sdf>')


def _scene_file(path: Path) -> None:
    """Tables of the soccer scene, a mesh of ours."""
    _box_obj(path.with_name("box.obj"))
    text = (SCENES / "soccer" / "scene.toml").read_text()
    text = re.sub(
        r"(?m)^file = .*$", 'file = "box.obj"\nmeters_per_unit = 1.0\nup_axis = "y"', text
    )
    text = re.sub(r"(?m)^baked = .*$", 'shading = "matte"', text)  # the mesh is not the scene's
    labels = LINES.findall(text)
    path.write_text(LINES.sub("", text) + "".join(labels[:4]))


def _baked_light(path: Path) -> None:
    _box_obj(path.with_name("box.obj"))
    path.write_text('file = "box.obj"\n[light]\nbaked = "a"\n')
    write_baked(path.with_name("a"), read_scene(path, baked="none"), np.abs, spacing_m=10.0)


def _gazebo_world(path: Path) -> None:
    """World with every geometry, and a model that it includes."""
    cup = path.with_name("cup")
    cup.mkdir()
    for folder in (path.parent, cup):
        _box_obj(folder / "box.obj")
    (cup / "model.config").write_text("<model><sdf version='1.9'>cup.sdf</sdf></model>")
    (cup / "cup.sdf").write_text(GAZEBO_MODEL)
    (cup / "cup.material").write_text("material Cup { diffuse 0.1 0.2 0.3 1 }")
    path.write_text(GAZEBO_WORLD)


def _urdf(path: Path) -> None:
    """Robot with every geometry, and a package beside it."""
    path.with_name("pack").mkdir()
    _box_obj(path.with_name("pack") / "box.obj")
    path.write_text(URDF)


def _mujoco_model(path: Path) -> None:
    """Model with every geom, and a mesh."""
    _box_obj(path.with_name("box.obj"))
    text = SHAPES.replace("</asset>", '<mesh name="wood" file="box.obj"/></asset>')
    text = text.replace("</worldbody>", '<geom type="mesh" mesh="wood"/></worldbody>')
    path.write_text(text)


def _moving_objects(path: Path) -> None:
    """Objects of every motion, in a scene that extends another."""
    _scene_file(path.with_name("scene.toml"))
    write_trajectory(path.with_name("ball.tum"), _trajectory(), "tum")
    path.write_text(OBJECTS)


def _robot(path: Path) -> None:
    _box_obj(path.with_name("box.obj"))
    text = p2at_with_every_sensor().replace("p2at.glb", "box.obj")
    text = re.sub(r"(?m)^hides = .*$", 'hides = ["box"]', text)
    path.write_text(text)
    shutil.copy(SCENES / "p2at" / "omnicam.toml", path.parent)


def _usd_stage(path: Path) -> None:
    """Stage with all that is read of one."""
    path.with_name("wood.png").write_bytes(png(np.arange(48).reshape(4, 4, 3)))
    write_sample(path)


def _read_usd_scene(path: Path) -> None:
    """Read a stage; usd-core has no end with some that are damaged."""
    usd_reader.LIMIT_CPU_S = 5
    _read_scene(path)


def _sensors(folder: Path) -> None:
    """Sensor file of each camera model."""
    for name, camera in CAMERA_EXAMPLES.items():
        if type(camera).__name__ != "MirroredCamera":
            sensor = OmniCamera(camera, polygons=None)
            (folder / f"{name.replace(' ', '-')}.toml").write_text(sensor.to_toml())


def _read_sensors(folder: Path) -> None:
    """Read the one that is damaged: the last that was written."""
    path = max(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns)
    OmniCamera.from_file(path).model.ray_from_pixel([[0.0, 0.0], [9.0, 5.0]])


def _read_optics(folder: Path) -> None:
    """Read all of them: one is damaged, or a profile that it names."""
    for path in sorted(folder.glob("*.toml")):
        read_optics_file(path).rays([[180.0, 100.0], [9.0, 5.0]])


def _optics_sensors(folder: Path) -> None:
    """Sensor files with systems in place: of every shape, and of a table of points."""
    for path in sorted(OPTICS.glob("*.toml")):
        system = dataclasses.replace(read_optics_file(path), chromatic="port" in path.stem)
        sensor = OmniCamera(system).resized(SIZE_PX)
        text = re.sub(r"(?m)^([rz]_m = \[)(.*)\]$", _fewer, sensor.to_toml())
        (folder / path.name).write_text(text)


def _fewer(found: re.Match[str]) -> str:
    """Every 50th point of a table: damage is to reach the other keys, too."""
    return found[1] + ", ".join(found[2].split(", ")[::50]) + "]"


def _read_optics_sensors(folder: Path) -> None:
    """Read all of them."""
    for path in sorted(folder.glob("*.toml")):
        OmniCamera.from_file(path).resized(SIZE_PX).model.ray_from_pixel([[9.0, 5.0], [20.0, 3.0]])


def _optics_mount(path: Path) -> None:
    sensor = OmniCamera(read_optics_file(OPTICS / "tilted-mirror.toml")).resized(SIZE_PX)
    path.write_text(sensor.calibration_json())


@cache
def _vehicle() -> Vehicle:
    return Vehicle.load("superscout").with_cameras(size_px=SIZE_PX)


@cache
def _soccer():
    return read_scene("soccer")


CORNERS = "image,x_m,y_m,u_px,v_px\n" + "".join(
    f"0,{x},{y},{100 + 9 * x},{80.5 + 9 * y}\n" for x in range(3) for y in range(3)
)
WAYPOINTS = "x_m,y_m\n-1.0,0.5\n0.2,0.5\n0.2,1.5\n"


@cache
def _trajectory():
    path = Path("corner.csv")
    path.write_text(WAYPOINTS)
    route = Route(str(path), step_m=0.3, step_deg=30.0)
    truth = plan_route(_soccer(), _vehicle(), route).trajectory
    path.unlink()
    return truth


def _odometry(path: Path) -> None:
    write_odometry(path, simulate_odometry(_trajectory(), _vehicle().odometry, 7))


def _metadata(camera: OmniCamera) -> dict[str, object]:
    base = pose((0.0, 0.0, 0.5))
    return {
        "camera": camera.model.parameters(),
        "polygons": camera.polygons,
        "world_from_base": base.tolist(),
        "world_from_optical": (base @ camera.base_from_optical).tolist(),
    }


def _image(path: Path) -> None:
    rng, size = np.random.default_rng(3), (SIZE_PX, SIZE_PX, 3)
    is_float = path.suffix == ".exr"
    pixels = rng.random(size).astype("f4") if is_float else rng.integers(0, 256, size, np.uint8)
    write_image(path, pixels, _metadata(OmniCamera().resized(SIZE_PX)))


def _arrays() -> dict[str, np.ndarray]:
    return {
        name: np.ones((SIZE_PX, SIZE_PX, len(channel.layers)), channel.dtype).squeeze()
        for name, channel in CHANNELS.items()
    }


def _channels(path: Path) -> None:
    write_exr(path, _arrays(), None, _metadata(OmniCamera().resized(SIZE_PX)))


def _sidecars(path: Path, channel_format: str) -> None:
    rgba = np.zeros((SIZE_PX, SIZE_PX, 4), np.uint8)
    labels = Labels((ClassLabel(1, "wall", (1, 2, 3)),), (InstanceLabel(1, "wall_1", 1),), "table")
    frame = Frame(rgba, None, _metadata(OmniCamera().resized(SIZE_PX)), _arrays(), labels)
    frame.save(path, channel_format=channel_format)


def _read_sidecars(path: Path) -> None:
    stored = StoredChannels(path, _metadata(OmniCamera().resized(SIZE_PX)))
    repr(stored.labels)
    stored.read(stored.names)


def _colors(path: Path) -> None:
    counts = np.zeros((3, BINS**3))
    counts[:, :9] = 5.0
    model = ColorModel(("yellow", "blue"), counts, (4.9, 4.9), smoothing=1.0)
    save_model(path, model, _soccer().landmarks)


def _states(path: Path) -> None:
    """True states along a trajectory."""
    write_states(path, SplineMotion(_trajectory()), (_trajectory().times_s,))


def _run(folder: Path) -> None:
    """Run of two steps as a drive leaves it, its images by us: without OpenGL."""
    (folder / "path.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    _scene_file(folder / "scene.toml")
    scene = read_scene(folder / "scene.toml")
    route = Route(str(folder / "path.csv"), step_m=1.0)
    plan = Drive(scene, _vehicle(), route, channels=("instance",)).plan()
    with open_run(folder / "run", _manifest(plan)) as run:
        plan._write_records(run)
        for step in range(len(plan.truth)):
            stem = folder / f"run/omnicam/{step:06d}"
            _image(stem.with_suffix(".png"))
            _channels(stem.with_suffix(".channels.exr"))
            stem.with_suffix(".coco.json").write_text("{}")
        labels = find_labels(scene).to_json()
        (run.path / "labels.json").write_text(json.dumps(labels))


def _manifest(plan) -> dict[str, object]:
    content = plan._manifest("none")
    content["scene"]["file"] = "soccer"
    content["libraries"] = {}
    return content


def _read_run(folder: Path) -> None:
    run = read_run(folder / "run", str(folder / "scene.toml"))
    run.notices  # noqa: B018
    for image in run.images():
        image.sum()
    if run.truth is not None:
        run.true_poses  # noqa: B018
    RunLabels(run, landmark_colors(run.landmarks))(0)
    content = read_manifest(run.folder.path / "manifest.json")
    with open_run(run.folder.path, content):
        pass


def _scan() -> Scan:
    scanner = LaserScanner.lms200(1.0)
    angles_rad = np.radians(np.linspace(-90.0, 90.0, 5))
    ranges_m = np.array([1.0, math.inf, 2.5, -math.inf, 3.0])
    return Scan(angles_rad, ranges_m, scanner, pose((1.0, 2.0, 0.3)), {"scan_number": 1})


def _read_scan(path: Path) -> None:
    table = read_table(path, "beam", "angle_deg", "range_m")
    table.header.pose("world_from_scanner")
    table.header.number("range_max_m")


def _cloud(path: Path) -> None:
    points = np.zeros(3, dtype=POINT)
    points["x"] = 1.0, 2.0, 3.0
    lidar = SpinningLidar.vlp16()
    PointCloud(points, lidar, pose(), pose((1.0, 0.0, 0.0))).save(path)


def _read_cloud(path: Path) -> None:
    cloud = read_cloud(path)
    cloud.header.pose("world_from_lidar")
    cloud.points["x"].sum()


def _export(folder: Path) -> None:
    with tempfile.TemporaryDirectory() as parent:
        list(export_run(folder / "run", "tum", Path(parent) / "out"))


def _read_scene(path: Path) -> None:
    scene = read_scene(path)
    find_labels(scene).notices()
    scene.bounds_m()
    repr(scene)
    for moving in scene.objects:
        for time_s in (0.0, 1.5, -1e6, 1e6):
            moving.motion.pose_at(time_s)


def _read_calibration(path: Path) -> None:
    for camera in load_calibration(path).cameras:
        camera.camera.ray_from_pixel([[0.0, 0.0], [9.0, 5.0]])


def _read_image(path: Path) -> None:
    taken = read_captured_image(path)
    view = cylinder_view(16, -0.5, 0.3)
    rotation = taken.base_from_optical.T @ view.base_from_view
    with suppress(OpticsError):  # the image shows nothing of this view
        Unwarping(taken.camera, view.camera, rotation, taken.covered)(taken.pixels)


def _read_route(path: Path) -> None:
    plan_route(_soccer(), _vehicle(), Route(str(path), rate_hz=None))


def _import_robots(path: Path) -> None:
    import_robot(path, "OmniP2AT").write(path.with_name("robot.toml"))


def _import_gazebo(path: Path) -> None:
    import_model(path).write(path.with_name("robot.toml"))


def _readers() -> list[Reader]:
    scene = [
        Reader("glb", "a.glb", lambda path: path.write_bytes(glb(*skinned_and_textured())),
               _read_scene),
        Reader("gltf", "box.gltf", _gltf_json, _read_scene),
        Reader("glb-meshopt", "a.glb", lambda path: compressed_tetrahedron().write(path),
               _read_scene),
        Reader("obj", "box.obj", _box_obj, _read_scene),
        Reader("sdf", "a.world", _gazebo_world, _read_scene,
               ("a.world", "cup/cup.sdf", "cup/model.config", "cup/cup.material", "wood.png")),
        Reader("sdf-dae", "a.world", _collada_submesh, _read_scene, ("a.dae",)),
        Reader("urdf", "a.urdf", _urdf, _read_scene, ("a.urdf",)),
        Reader("mujoco", "a.xml", _mujoco_model, _read_scene, ("a.xml",)),
        Reader("scene-toml", "scene.toml", _scene_file, _read_scene, ("scene.toml",)),
        Reader("baked", "scene.toml", _baked_light, _read_scene, BAKED_FILES),
        Reader("objects", "objects.toml", _moving_objects, _read_scene,
               ("objects.toml", "ball.tum")),
    ]  # fmt: skip
    if is_installed("DracoPy"):
        draco = colored_draco_triangle()
        scene.append(Reader("glb-draco", "a.glb", draco.write, _read_scene))
    for name in ("usda", "usdc") if is_installed("pxr") else ():
        file = f"a.{name}"
        scene.append(Reader(name, file, _usd_stage, _read_usd_scene, (file,)))
    scene += [
        Reader("ply-text", "a.ply", partial(_mesh, encoding="ascii"), _read_scene),
        Reader("ply", "a.ply", _mesh, _read_scene),
        Reader("stl", "a.stl", _mesh, _read_scene),
        Reader("stl-text", "a.stl", partial(_mesh, file_type="stl_ascii"), _read_scene),
        Reader("off", "a.off", _mesh, _read_scene),
        Reader("dae", "a.dae", _mesh, _read_scene),
    ]
    tables = [
        Reader("sensor", "a.toml", DEFAULT_SENSOR_FILE, OmniCamera.from_file),
        Reader("sensor-lens", "a.toml", SENSOR, OmniCamera.from_file),
        Reader("sensor-models", "", _sensors, _read_sensors),
        Reader("optics", "", partial(shutil.copytree, OPTICS, dirs_exist_ok=True), _read_optics),
        Reader("corners", "a.csv", CORNERS, read_corners),
        Reader("sensor-optics", "", _optics_sensors, _read_optics_sensors),
        Reader("mount-optics", "calibration.json", _optics_mount, read_mount),
        Reader("preset", "a.toml", PRESETS / "bad-day.toml",
               lambda path: preset(path.name, path.parent)),
        Reader("labels", "a.toml", LABELS, read_label_file),
        Reader("filter", "a.toml", FILTER_FILE, read_parameters),
        Reader("robot", "robot.toml", _robot, Vehicle.load, ("robot.toml", "omnicam.toml")),
        Reader("gazebo-robot", "a.sdf", GAZEBO_ROBOT, _import_gazebo),
        Reader("urdf-robot", "a.urdf", URDF_ROBOT, load_robot_model),
        Reader("mujoco-robot", "a.xml", MUJOCO_ROBOT, load_robot_model),
        Reader("usarsim", "a.ini", ROBOTS_INI, _import_robots),
    ]  # fmt: skip
    calibrations = [Reader(path.name, path.name, path, _read_calibration) for path in EXACT_SAMPLES]
    routes = [
        Reader(f"{name}-poses", "a.txt",
               lambda path, name=name: write_trajectory(path, _trajectory(), name), _read_route)
        for name in FORMATS
    ]  # fmt: skip
    routes += [
        Reader("waypoints", "a.csv", WAYPOINTS, _read_route),
        Reader("odometry", "a.csv", _odometry, read_odometry),
    ]
    images = [
        Reader(f"image-{name}", f"a.{name}", _image, _read_image)
        for name in ("png", "jpg", "exr", "tif")
    ]
    images += [
        Reader("channels", "a.exr", _channels, read_channels),
        Reader("rays", "a.exr",
               lambda path: write_ray_table(path, OmniCamera().resized(SIZE_PX).model),
               read_ray_table),
        Reader("colors", "a.npz", _colors, load_model),
        Reader("sidecars-auto", "a.png", partial(_sidecars, channel_format="auto"),
               _read_sidecars),
        Reader("sidecars-npy", "a.png", partial(_sidecars, channel_format="npy"), _read_sidecars),
    ]  # fmt: skip
    measurements = [
        Reader("states", "a.csv", _states, read_states),
        Reader("times", "a.csv", "t_s\n0.100000000\n0.200000000\n",
               lambda path: read_times(path, 2)),
        Reader("scan", "a.csv", lambda path: _scan().save_csv(path), _read_scan),
        Reader("cloud-ply", "a.ply", _cloud, _read_cloud),
        Reader("cloud-pcd", "a.pcd", _cloud, _read_cloud),
    ]  # fmt: skip
    runs = [
        Reader("run", "", _run, _read_run, RUN_FILES),
        Reader("export", "", _run, _export, RUN_FILES),
        Reader("plan", "plan.toml", PLAN, read_plan),
        Reader("data-set", "", write_data_set, read_data_set),
    ]
    return [*scene, *tables, *calibrations, *routes, *images, *measurements, *runs]


RUN_FILES = (
    "run/manifest.json", "run/ground_truth.tum", "run/odometry.csv", "run/states.csv",
    "run/labels.json",
    "run/omnicam/calibration.json", "run/omnicam/000000.png", "run/omnicam/000001.channels.exr",
    "run/omnicam/000000.channels.exr",
)  # fmt: skip
SENSOR = """
[virtual_cameras]
near_m = 0.05
far_m = 80.0
[camera]
supersampling = 2
[lens]
model = "unified"
width_px = 64
height_px = 48
focal_lengths_px = [20.0, 20.0]
principal_point_px = [31.5, 23.5]
xi = 0.9
skew_px = 0.0
distortion = [-0.1, 0.01, 0.0, 0.0]
[degradation]
preset = "webcam"
[degradation.vignetting]
enabled = true
"""
GAZEBO_MODEL = """<sdf version="1.9"><model name="cup" placement_frame="f">
<frame name="f"><pose degrees="true">1 0 0 0 90 0</pose></frame>
<link name="a"><pose relative_to="f">0 0 1 0 0 0</pose>
<visual name="v"><transparency>0.5</transparency><geometry><mesh><uri>box.obj</uri>
<scale>1 2 1</scale><submesh><name>box</name><center>true</center></submesh></mesh></geometry>
<material><script><uri>model://cup</uri><name>Cup</name></script></material></visual>
<light name="l" type="spot"><attenuation><range>9</range></attenuation>
<spot><inner_angle>0.1</inner_angle><outer_angle>1</outer_angle></spot></light></link>
<joint name="j"><child>a</child></joint></model></sdf>
"""
GAZEBO_WORLD = """<sdf version="1.9"><world name="w">
<scene><background>0.1 0.2 0.3</background></scene>
<include><uri>model://cup</uri><name>one</name><pose rotation_format="quat_xyzw">
1 2 0 0 0 0 1</pose></include><include merge="true"><uri>cup</uri></include>
<light name="sun" type="directional"><direction>0 1 -1</direction></light>
<model name="m"><link name="l">
<visual name="a"><geometry><box><size>1 2 3</size></box></geometry><material>
<diffuse>1 0 0 1</diffuse><pbr><metal><albedo_map>wood.png</albedo_map></metal></pbr>
</material></visual>
<visual name="b"><geometry><sphere><radius>0.1</radius></sphere></geometry></visual>
<visual name="c"><geometry><ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid></geometry></visual>
<visual name="d"><geometry><cylinder><radius>0.1</radius><length>1</length></cylinder></geometry>
</visual><visual name="e"><geometry><cone><radius>0.1</radius><length>1</length></cone></geometry>
</visual><visual name="f"><geometry><capsule><radius>0.1</radius><length>1</length></capsule>
</geometry></visual><visual name="g"><geometry><plane><normal>0 1 1</normal><size>2 3</size>
</plane></geometry></visual><visual name="h"><geometry><polyline><point>0 0</point>
<point>3 0</point><point>0 3</point><height>2</height></polyline><polyline><point>1 1</point>
<point>1 0.5</point><point>0.5 1</point></polyline></geometry></visual>
<visual name="i"><geometry><heightmap><uri>wood.png</uri><size>3 4 1</size><texture><diffuse>
wood.png</diffuse><size>2</size></texture><texture><diffuse>wood.png</diffuse><size>1</size>
</texture><blend><min_height>0.2</min_height><fade_dist>0.1</fade_dist></blend></heightmap>
</geometry></visual>
</link><pose relative_to="one::f">1 2 3 0.1 0.2 0.3</pose></model>
<state world_name="w"><model name="m"><pose>0 0 1 0 0 0</pose><link name="l">
<pose>0 1 0 0 0 0</pose></link></model><light name="sun">
<pose>0 0 9 0 0 0</pose></light></state></world></sdf>
"""
WHEEL = """<link name="{0}"><inertial><mass value="1"/></inertial>
<collision><geometry><cylinder radius="0.1" length="0.1"/></geometry></collision></link>
<joint name="{0}" type="continuous"><parent link="base"/><child link="{0}"/>
<origin xyz="0 {1} 0.1"/><axis xyz="0 1 0"/><limit velocity="9"/></joint>"""
URDF_ROBOT = f"""<robot name="r"><link name="base"><visual><geometry><box size="1 2 3"/></geometry>
</visual></link>{WHEEL.format("left", 1)}{WHEEL.format("right", -1)}
<gazebo reference="left"><sensor name="imu" type="imu"><pose>0 0 1 0 0 0</pose></sensor></gazebo>
<gazebo><plugin filename="diff_drive"><max_linear_velocity>2</max_linear_velocity></plugin></gazebo>
</robot>"""
MUJOCO_ROBOT = """<mujoco><worldbody><body name="cart"><freejoint/>
<geom type="box" size=".3 .2 .05"/>
<camera name="eye" pos=".4 0 .3" xyaxes="0 -1 0 0 0 1"/><site name="chip"/>
<body pos="0 .2 0"><joint axis="0 1 0"/><geom type="cylinder" size=".1 .03" zaxis="0 1 0"/></body>
<body pos="0 -.2 0"><joint axis="0 1 0"/><geom type="cylinder" size=".1 .03" zaxis="0 1 0"/></body>
</body></worldbody><sensor><gyro site="chip"/></sensor></mujoco>"""
URDF = """<robot name="r"><material name="m"><color rgba="1 0 0 0.5"/></material>
<link name="a"><visual><geometry><box size="1 2 3"/></geometry><material name="m"/></visual>
<visual name="s"><origin xyz="0 0 1" rpy="1 2 3"/><geometry><sphere radius="0.5"/></geometry>
<material name="t"><texture filename="pack/wood.png"/></material></visual></link>
<link name="b"><visual><geometry><cylinder radius="0.2" length="2"/></geometry></visual>
<visual><geometry><mesh filename="package://pack/box.obj" scale="1 1 2"/></geometry></visual></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/>
<axis xyz="0 1 0"/><limit lower="0.2" upper="0.6"/></joint></robot>
"""
OBJECTS = """
extends = "scene.toml"
[[objects]]
name = "ball"
file = "box.obj"
rolling_radius_m = 0.11
orbit = { center_m = [0.0, 0.0, 0.11], radius_m = 0.6, period_s = 6.0, start_deg = 30.0 }
[[objects]]
name = "cart"
file = "box.obj"
up_axis = "z"
shuttle = { from_m = [0.0, 0.0, 0.0], to_m = [1.0, 1.0, 0.0], period_s = 4.0 }
[[objects]]
name = "walker"
file = "box.obj"
path = { times_s = [0.0, 2.0], positions_m = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], repeats = true }
[[objects]]
name = "robot"
file = "box.obj"
trajectory = { file = "ball.tum", repeats = false }
[[objects]]
name = "crate"
file = "box.obj"
position_m = [1.0, 0.0, 0.0]
mass_kg = 2.0
[[objects]]
name = "post"
file = "box.obj"
position_m = [1.0, 0.0, 0.0]
yaw_deg = 20.0
"""
LABELS = """
[[labels]]
name = "goal"
color = [250, 210, 0]
nodes = ["goal_*", "post"]
id = 3
[[labels]]
name = "wall"
nodes = ["*"]
"""
READERS = {reader.name: reader for reader in _readers()}
