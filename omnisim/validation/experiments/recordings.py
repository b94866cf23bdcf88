"""Drives of the experiments; each is recorded once, and resumes after an interruption."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from omnisim.core.errors import RunError
from omnisim.rendering.camera.degradations import Degradation, preset
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.runs.run_data import RunData, read_run
from omnisim.scene import load_scene
from omnisim.scene.model import Scene, ScenePath
from omnisim.validation.experiments.experiment_runs import Progress
from omnisim.validation.experiments.real_setting import cluttered

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
        scene, paths=(*scene.paths, ScenePath("learning", TRAINING_WAYPOINTS))
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
    folder: Path, scene: Scene, vehicle: Vehicle, path: str, device: int | None, progress: Progress
) -> RunData:
    drive = Drive(scene, vehicle, Route(path), device=device, channels=("instance",))
    plan = drive.plan()
    steps = plan.record(folder)
    try:
        done = next(steps)
    except RunError:  # another scene, robot or version: the experiments' own folder is renewed
        steps = plan.record(folder, force=True)
        done = next(steps)
    total = len(plan.truth)
    counted = progress(f"drive: {folder.name}", total)(range(total))
    for count in counted:
        if count >= done:
            next(steps, None)
    for _ in steps:  # finish the recording
        pass
    return read_run(folder)
