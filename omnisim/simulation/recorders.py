"""Recorders of a drive's sensors: they write what is missing of a step into the run's folder.

A camera moves while its picture is exposed, has noise of its own, and its auto-exposure follows
from the picture before. The two numbers that it takes are in the metadata of that picture's file,
so that a drive that was killed goes on with the same bytes.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from omnisim.errors import OmnisimError, RunError
from omnisim.frame import Frame
from omnisim.image_files import read_image
from omnisim.robot import Trajectory
from omnisim.sensors import LaserRenderer, Renderer
from omnisim.simulation.run_channels import write_step
from omnisim.simulation.run_folder import RunFolder, is_written
from omnisim.simulation.vehicle import MountedCamera, MountedScanner
from omnisim.world import WorldState


@dataclass(frozen=True, eq=False)
class CameraRecorder:
    """Recorder of a camera's pictures and their channels of ground truth.

    Attributes:
        camera: on the vehicle.
        renderer: of the camera.
        truth: poses of the vehicle.
    """

    camera: MountedCamera
    renderer: Renderer
    truth: Trajectory

    def record(self, run: RunFolder, step: int) -> None:
        """Write what is missing of a step, of which all pictures before are in the folder.

        Raises:
            RunError: the picture before it lacks its exposure.
            OutputError: a file cannot be written.
        """
        name = self.camera.name
        if all(is_written(file) for file in run.camera_files(name, step)):
            return
        frame = self._render(run, step)
        write_step(run, name, step, frame)
        picture = run.file(name, step, ".png")
        if not is_written(picture):
            dataclasses.replace(frame, channels={}).save(picture)

    def _render(self, run: RunFolder, step: int) -> Frame:
        render = partial(
            self.renderer.render,
            self._state(step),
            also=run.channels_at(step),
            next_state=self._state(step + 1) if step + 1 < len(self.truth) else None,
            previous_state=self._state(step - 1) if step > 0 else None,
        )
        if self.renderer.camera.degradation.is_ideal:
            return render()
        return render(
            motion=self.truth.pose_at, frame_number=step, exposure_ev=self._exposure_ev(run, step)
        )

    def _state(self, step: int) -> WorldState:
        time_s = float(self.truth.times_s[step])
        return WorldState({self.renderer.vehicle: self.truth.world_from_base[step]}, time_s)

    def _exposure_ev(self, run: RunFolder, step: int) -> float | None:
        """Exposure that auto-exposure has reached; None: settled on the picture itself."""
        degradation = self.renderer.camera.degradation
        if step == 0 or degradation.exposure is None or not degradation.is_metered:
            return None
        ev, metered_ev = _read_exposure(run.file(self.camera.name, step - 1, ".png"))
        later_s = float(self.truth.times_s[step] - self.truth.times_s[step - 1])
        return degradation.exposure.next_ev(ev, metered_ev, later_s)


@dataclass(frozen=True, eq=False)
class ScannerRecorder:
    """Recorder of a laser scanner's scans.

    Attributes:
        scanner: on the vehicle.
        renderer: of the scanner.
        truth: poses of the vehicle.
    """

    scanner: MountedScanner
    renderer: LaserRenderer
    truth: Trajectory

    def record(self, run: RunFolder, step: int) -> None:
        """Write the scan of a step where it is missing.

        Raises:
            OutputError: the file cannot be written.
        """
        target = run.file(self.scanner.name, step, ".csv")
        if is_written(target):
            return
        self.renderer.scan(self.truth.world_from_base[step], step).save_csv(target)


def noise_seed(drive_seed: int, camera_name: str) -> str:
    """Seed of one camera's noise: no two cameras of a vehicle share one."""
    return f"{drive_seed} {camera_name}"


def check_exposure(camera: MountedCamera, truth: Trajectory) -> None:
    """Refuse an exposure that has not ended when the next picture begins.

    Raises:
        RunError: naming camera, step, and what is expected.
    """
    exposure_s = camera.sensor.degradation.exposure_s
    periods_s = np.diff(truth.times_s)
    if np.any(periods_s < exposure_s):
        step = int(np.argmin(periods_s))
        raise RunError(
            f"camera {camera.name!r}: degradation.shutter.exposure_s: expected at most "
            f"{periods_s[step]:g} s, the time from step {step} to {step + 1}, got {exposure_s:g}"
        )


def _read_exposure(path: Path) -> tuple[float, float]:
    """Exposure and metered exposure in the metadata of a picture, EV."""
    try:
        _, metadata = read_image(path)
        exposure = (metadata or {})["degradation"]["exposure"]
        return float(exposure["ev"]), float(exposure["metered_ev"])
    except (OmnisimError, KeyError, TypeError, ValueError):
        raise RunError(
            f"{path}: has no exposure, which the next picture's follows from: remove it, and it "
            "is taken again"
        ) from None
