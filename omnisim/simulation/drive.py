"""A drive: a vehicle along a path through a scene, everything that its sensors tell, on disk."""

from __future__ import annotations

import dataclasses
import json
import platform
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from omnisim.errors import RunError
from omnisim.gpu.context import graphics_info
from omnisim.robot import Trajectory, simulate_odometry, write_odometry, write_trajectory
from omnisim.robot.odometry import Odometry
from omnisim.scene import Scene
from omnisim.scene.labels import find_labels
from omnisim.sensors import LaserRenderer, Renderer
from omnisim.sensors.degradations import Degradation
from omnisim.sensors.stage import Stage
from omnisim.simulation.fingerprint import fingerprint
from omnisim.simulation.picture_taking import check_exposure, noise_seed, take_picture
from omnisim.simulation.route import Route, plan_route
from omnisim.simulation.run_channels import (
    write_boxes,
    write_labels,
    write_step,
)
from omnisim.simulation.run_folder import (
    GROUND_TRUTH,
    MANIFEST_FORMAT,
    ODOMETRY,
    RunFolder,
    is_written,
)
from omnisim.simulation.sensor_toml import sensor_toml
from omnisim.simulation.vehicle import MountedCamera, Vehicle
from omnisim.version import __version__

LARGEST_SEED = 2**63 - 1


@dataclass(frozen=True, eq=False)
class Drive:
    """What is driven: everything that the run's files follow from.

    Attributes:
        scene: where.
        vehicle: with its sensors.
        route: along what path.
        seed: of the odometry's and the cameras' noise; a scanner's noise has its own, from the
            robot file.
        unlit: show plain base colours.
        device: EGL's number of the GPU, or None.
        up_axis: that the scene was loaded with, for the record, or None.
        channels: of ground truth, as `check_channels` gives them.
    """

    scene: Scene
    vehicle: Vehicle
    route: Route
    seed: int = 0
    unlit: bool = False
    device: int | None = None
    up_axis: str | None = None
    channels: tuple[str, ...] = ()

    def plan(self) -> Plan:
        """Work out where the vehicle is at each step, and what its wheels report.

        Raises:
            TrajectoryError: a path that cannot be driven.
            RunError: a seed that is none, or an exposure longer than a step.
        """
        if not 0 <= self.seed <= LARGEST_SEED:
            raise RunError(f"seed {self.seed}: want a whole number from 0 to 2**63 - 1")
        truth = plan_route(self.scene, self.vehicle, self.route)
        for camera in self.vehicle.cameras:
            check_exposure(camera, truth)
        odometry = simulate_odometry(truth, self.vehicle.odometry, self.seed)
        return Plan(self, truth, odometry)


@dataclass(frozen=True, eq=False)
class Plan:
    """A drive that is worked out, but for what the sensors see.

    Attributes:
        drive: what is driven.
        truth: poses of the base.
        odometry: what the wheels report.
    """

    drive: Drive
    truth: Trajectory
    odometry: Odometry

    def record(self, folder: Path, force: bool = False) -> Iterator[int]:
        """Render what is missing in the folder, step by step; yields how many steps are there.

        The first number is how many were there before. Killed and called again it goes on, and
        ends with the same bytes as if it had never stopped.

        Args:
            folder: of the run.
            force: throw another run away that is there.

        Raises:
            RunError: another run is there, or another drive is writing to it.
            OmnisimError: OpenGL is not there, or a file cannot be written.
        """
        drive, vehicle = self.drive, self.drive.vehicle
        with ExitStack() as stack:
            scene = _named_shortly(drive.scene)
            stage = stack.enter_context(Stage(scene, vehicle.body, device=drive.device))
            cameras = {
                camera.name: stack.enter_context(
                    Renderer(
                        stage,
                        camera.sensor,
                        hidden=camera.hides,
                        unlit=drive.unlit,
                        seed=noise_seed(drive.seed, camera.name),
                    )
                )
                for camera in vehicle.cameras
            }
            scanners = {
                scanner.name: stack.enter_context(
                    LaserRenderer(stage, scanner.scanner, hidden=scanner.hides)
                )
                for scanner in vehicle.scanners
            }
            told = self.manifest(graphics_info(stage.context).renderer)
            run = stack.enter_context(closing(RunFolder.open(folder, told, force)))
            self._write_records(run)
            labels = find_labels(drive.scene, stage.moving)
            write_labels(run, labels)
            missing = [step for step in range(len(self.truth)) if not run.is_done(step)]
            there = len(self.truth) - len(missing)
            yield there
            for done, step in enumerate(missing, start=there + 1):
                world_from_base = self.truth.world_from_base[step]
                for name, renderer in cameras.items():
                    self._take(run, name, renderer, step)
                for mounted in vehicle.scanners:
                    target = run.file(mounted.name, step, ".csv")
                    if not is_written(target):
                        world_from_scanner = world_from_base @ mounted.base_from_scanner
                        scan = scanners[mounted.name].scan(
                            world_from_scanner, step, world_from_base=world_from_base
                        )
                        scan.save_csv(target)
                yield done
            write_boxes(run, labels)

    def _take(self, run: RunFolder, camera: str, renderer: Renderer, step: int) -> None:
        """Render what is missing of a camera's files at a step."""
        if all(is_written(file) for file in run.camera_files(camera, step)):
            return
        poses = self.truth.world_from_base
        also = run.channels_at(step)
        following = poses[step + 1] if "flow" in also else None
        frame = take_picture(renderer, camera, self.truth, step, run, also, following)
        write_step(run, camera, step, frame)
        picture = run.file(camera, step, ".png")
        if not is_written(picture):
            dataclasses.replace(frame, channels={}).save(picture)

    def manifest(self, renderer: str) -> dict[str, Any]:
        """What makes the run, as JSON can hold it.

        Args:
            renderer: what draws, by OpenGL's name of it: others round differently.
        """
        drive, vehicle = self.drive, self.drive.vehicle
        return {
            "format": MANIFEST_FORMAT,
            "omnisim": __version__,
            "scene": {
                "name": _named_shortly(drive.scene).name,
                "file": _place(drive.scene.name),
                "up_axis": drive.up_axis,
                "contents": scene_contents(drive.scene),
            },
            "degradation": {
                camera.name: _as_json(camera.sensor.degradation.tables())
                for camera in vehicle.cameras
            },
            "quality": {
                camera.name: {
                    "supersampling": camera.sensor.supersampling,
                    "texels_per_pixel": camera.sensor.texels_per_pixel,
                }
                for camera in vehicle.cameras
            },
            "robot": {"name": vehicle.name, "contents": fingerprint(vehicle)},
            "path": {
                "name": Path(drive.route.path).name,
                "poses": fingerprint(self.truth.times_s, self.truth.world_from_base),
                "length_m": round(self.truth.path_length_m, 6),
                "duration_s": round(self.truth.duration_s, 6),
            },
            "steps": len(self.truth),
            "seed": drive.seed,
            "unlit": drive.unlit,
            "channels": list(drive.channels),
            "cameras": [camera.name for camera in vehicle.cameras],
            "scanners": [scanner.name for scanner in vehicle.scanners],
            "renderer": renderer,
            "libraries": {
                "python": platform.python_version(),
                **{name: metadata.version(name) for name in ("moderngl", "numpy", "trimesh")},
            },
        }

    def _write_records(self, run: RunFolder) -> None:
        """What is known before the first step."""
        if not run.has(GROUND_TRUTH):
            write_trajectory(run.path / GROUND_TRUTH, self.truth)
        if not run.has(ODOMETRY):
            write_odometry(run.path / ODOMETRY, self.odometry)
        for camera in self.drive.vehicle.cameras:
            for name, text in (
                ("sensor.toml", sensor_toml(camera.sensor)),
                ("calibration.json", _calibration(camera)),
            ):
                if not run.has(f"{camera.name}/{name}"):
                    run.write_text(f"{camera.name}/{name}", text)


def _as_json(tables: dict[str, Any]) -> dict[str, Any]:
    """Tables as a file gives them back: tuples are lists."""
    return json.loads(json.dumps(tables))


def scene_contents(scene: Scene) -> str:
    """The fingerprint of a scene, wherever its file is."""
    return fingerprint(_named_shortly(scene))


def _named_shortly(scene: Scene) -> Scene:
    """The scene under its file's name: where this machine has it makes no difference."""
    return dataclasses.replace(scene, name=Path(scene.name).name or scene.name)


def _place(name: str) -> str:
    """Where to find the scene again from another folder: its file's path, or its built-in name."""
    path = Path(name)
    is_there = path.is_file() or (path / "scene.toml").is_file()
    return str(path.resolve()) if is_there else name


def _calibration(camera: MountedCamera) -> str:
    told = {
        "camera": camera.sensor.model.parameters(),
        "polygons": camera.sensor.polygons or "exact",
        "base_from_optical": camera.sensor.base_from_optical.tolist(),
    }
    return json.dumps(told, indent=2) + "\n"


def with_cameras(
    vehicle: Vehicle,
    size_px: int | None,
    polygons: int | str | None,
    degradation: Degradation | None = None,
    quality: str | None = None,
) -> Vehicle:
    """The vehicle with other pictures: of another size or quality, by another mesh, or otherwise
    degraded.

    Args:
        vehicle: is left as it is.
        size_px: pixels of the shorter side, or None: as it is.
        polygons: of the mirror's mesh, None: exactly; or "same": as it is.
        degradation: of all cameras, or None: as their sensor files say.
        quality: "fast", "default" or "fine", or None: as their sensor files say.

    Raises:
        OpticsError: a size, polygon count or quality that cannot be.
    """
    cameras = []
    for camera in vehicle.cameras:
        sensor = camera.sensor
        if degradation is not None:
            sensor = sensor.with_degradation(degradation)
        if size_px is not None:
            sensor = sensor.resized(size_px)
        if quality is not None:
            sensor = sensor.with_quality(quality)
        if polygons != "same":
            sensor = sensor.with_polygons(polygons)
        cameras.append(dataclasses.replace(camera, sensor=sensor))
    return dataclasses.replace(vehicle, cameras=tuple(cameras))
