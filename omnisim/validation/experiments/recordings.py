"""Drives of the experiments; each is recorded once, and resumes after an interruption.

The paper's real setting is simulated, with clutter and a lamp that lights the field unevenly. As in
the paper: the robot, the clockwise path, landmarks picked by hand, a wrong start pose that the
filter takes as certain, and biased odometry. All numbers are ours; the paper gives none.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from omnisim.core.errors import RunError
from omnisim.core.poses import pose
from omnisim.core.trajectories.odometry import Odometry
from omnisim.rendering.camera.degradations import Degradation, preset
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.runs.run_data import RunData, read_run
from omnisim.scene import load_scene, model
from omnisim.validation.plain_scenes import quads

Progress = Callable[[str, int], Callable[[Iterable[int]], Iterable[int]]]
SCENE = "soccer"
# A path across the field for training, unlike all other drives: landmarks from near and far, and
# from all sides.
TRAINING_WAYPOINTS = (
    (-1.9, -0.9), (-0.6, 0.8), (0.7, -1.0), (1.9, 0.4), (0.4, 1.2), (-1.9, 0.5), (0.0, -0.3),
)  # fmt: skip
# The paper's camera, out of focus, and slow enough to blur at a turn rate of 90°/s.
REAL_PRESET = "dragonfly2"
REAL_DEFOCUS_PX = (1.0, 2.2)
REAL_EXPOSURE_S = 0.012
REAL_FULL_WELL_E = 2500.0
# Boxes around the field: x, y, edge in meters, and colors similar to the landmarks', as of
# cardboard and plastic. All are outside the carpet.
YELLOWISH, BLUISH, PINKISH = (0.80, 0.56, 0.04), (0.03, 0.36, 0.72), (0.72, 0.07, 0.30)
CLUTTER = (
    (-0.35, 2.55, 0.22, YELLOWISH),
    (0.30, 2.75, 0.30, BLUISH),
    (2.10, 2.60, 0.18, PINKISH),
    (-2.30, 2.70, 0.25, BLUISH),
    (-3.70, 1.30, 0.30, PINKISH),
    (-3.60, -1.40, 0.24, YELLOWISH),
    (3.60, 1.20, 0.26, YELLOWISH),
    (3.75, -1.20, 0.20, BLUISH),
    (0.45, -2.60, 0.24, PINKISH),
    (-0.60, -2.80, 0.34, YELLOWISH),
    (2.40, -2.70, 0.22, BLUISH),
)
# A lamp over one corner, with a third of the scene's even light.
LAMP_M, LAMP_CD, EVEN_SHARE = (-2.6, -1.9, 2.2), 3.2, 0.45
# Start pose given to the filter, minus the true one.
START_ERROR = (0.10, -0.10, math.radians(12.0))


@dataclass(frozen=True)
class Recordings:
    """Runs of the experiments."""

    learning: RunData  # training run, P2AT
    simulated: RunData  # the paper's simulation, P2AT, counter-clockwise
    real: RunData  # the paper's real setting, Super Scout, clockwise, degraded


def real_camera() -> Degradation:
    """Degradation of the real setting's camera."""
    base = preset(REAL_PRESET)
    center, rim = REAL_DEFOCUS_PX
    assert base.defocus is not None
    assert base.shutter is not None
    assert base.noise is not None
    return dataclasses.replace(
        base,
        defocus=dataclasses.replace(base.defocus, center_defocus_px=center, rim_defocus_px=rim),
        shutter=dataclasses.replace(base.shutter, exposure_s=REAL_EXPOSURE_S),
        noise=dataclasses.replace(base.noise, full_well_e=REAL_FULL_WELL_E),
    )


def record_all(folder: Path, device: int | None, progress: Progress) -> Recordings:
    """Record the drives in an existing folder; only drives that do not match are recorded again.

    Raises:
        OmnisimError: no OpenGL, or a drive that cannot be recorded.
    """
    scene = load_scene(SCENE)
    with_path = dataclasses.replace(
        scene, paths=(*scene.paths, model.ScenePath("learning", TRAINING_WAYPOINTS))
    )
    p2at = _paper_vehicle("p2at")
    scout = _paper_vehicle("superscout").with_cameras(degradation=real_camera())
    return Recordings(
        _record(folder / "learning", with_path, p2at, "learning", device, progress),
        _record(folder / "simulated", scene, p2at, "lap", device, progress),
        _record(folder / "real", cluttered(scene), scout, "lap_clockwise", device, progress),
    )


def _paper_vehicle(robot: str) -> Vehicle:
    """The robot's vehicle with cameras only, whose mirror is the mesh of the paper."""
    vehicle = Vehicle.load(robot).with_cameras(polygons=PAPER_POLYGONS)
    return dataclasses.replace(vehicle, sensors=vehicle.cameras)


def _record(
    folder: Path, scene: model.Scene, vehicle: Vehicle, path: str, device: int | None,
    progress: Progress,
) -> RunData:  # fmt: skip
    drive = Drive(scene, vehicle, Route(path), device=device, channels=("instance",))
    plan = drive.plan()
    steps = plan.record(folder)
    try:
        done = next(steps)
    except RunError:  # another scene, robot or version: the experiments' own folder is renewed
        steps = plan.record(folder, force=True)
        done = next(steps)
    total = len(plan.truth)
    for count in progress(f"drive: {folder.name}", total)(range(total)):
        if count >= done:
            next(steps, None)
    for _ in steps:  # finish the recording
        pass
    return read_run(folder)


def cluttered(scene: model.Scene) -> model.Scene:
    """Scene with boxes around the field and a lamp over one corner."""
    materials, meshes = list(scene.materials), list(scene.meshes)
    instances = list(scene.instances)
    for number, (x, y, edge_m, color) in enumerate(CLUTTER, start=1):
        materials.append(model.Material(f"clutter_{number:02d}", (*color, 1.0)))
        meshes.append(_box(f"clutter_{number:02d}", edge_m, len(materials) - 1))
        place = pose((x, y, 0.5 * edge_m))
        instances.append(model.Instance(f"clutter_box_{number:02d}", len(meshes) - 1, place))
    even = [
        dataclasses.replace(light, intensity=EVEN_SHARE * light.intensity)
        for light in scene.lighting.lights
    ]
    lamp = model.Light(
        model.LightKind.POINT, (1.0, 0.93, 0.80), LAMP_CD, position_m=np.array(LAMP_M),
        range_m=math.inf, casts_shadow=False,
    )  # fmt: skip
    red, green, blue = scene.lighting.ambient
    ambient = (EVEN_SHARE * red, EVEN_SHARE * green, EVEN_SHARE * blue)
    return dataclasses.replace(
        scene,
        meshes=tuple(meshes),
        materials=tuple(materials),
        instances=tuple(instances),
        lighting=model.Lighting(ambient, (*even, lamp), scene.lighting.exposure),
    )


def with_wrong_start(odometry: Odometry) -> Odometry:
    """Odometry with the same readings and a wrong start pose."""
    x, y, yaw = odometry.start
    dx, dy, dyaw = START_ERROR
    return dataclasses.replace(odometry, start=(x + dx, y + dy, yaw + dyaw))


def _box(name: str, edge_m: float, material: int) -> model.Mesh:
    """Flat-shaded cube about the origin."""
    sides = []
    for axis, side in itertools.product(range(3), (-1.0, 1.0)):
        normal, right = np.eye(3)[axis] * side, np.eye(3)[(axis + 1) % 3]
        up = np.cross(normal, right)
        places = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        sides.append([0.5 * edge_m * (normal + a * right + b * up) for a, b in places])
    return quads(name, sides, material)
