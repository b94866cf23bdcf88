"""A camera on a drive: its motion between the steps, its noise, and its auto-exposure.

A picture's exposure follows from the picture before it. Both numbers that it takes are inside of
that picture's file, so that a drive that was killed goes on as if it had not been.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import OmnisimError, RunError
from omnisim.frame import Frame
from omnisim.image_files import read_image
from omnisim.robot import Trajectory
from omnisim.robot.interpolation import pose_at
from omnisim.sensors import Renderer
from omnisim.sensors.motion import PoseFunction
from omnisim.simulation.run_folder import RunFolder
from omnisim.simulation.vehicle import MountedCamera


def noise_seed(drive_seed: int, camera_name: str) -> str:
    """The seed of one camera's noise: no two cameras of a robot have the same."""
    return f"{drive_seed} {camera_name}"


def take_picture(
    renderer: Renderer,
    camera_name: str,
    truth: Trajectory,
    step: int,
    run: RunFolder,
    also: Collection[str] = (),
    next_base: NDArray[np.float64] | None = None,
) -> Frame:
    """The picture of a step; the pictures of all steps before it are in the run's folder.

    Args:
        renderer: of the camera.
        camera_name: in the run.
        truth: where the vehicle is.
        step: of the picture.
        run: it is going to be in.
        also: channels of ground truth.
        next_base: (4, 4) pose of the vehicle at the next step, which flow needs.

    Raises:
        RunError: the picture before it does not tell its exposure.
    """
    world_from_base = truth.world_from_base[step]
    if renderer.camera.degradation.is_ideal:
        return renderer.render(world_from_base, also=also, next_base=next_base)
    return renderer.render(
        world_from_base,
        also=also,
        next_base=next_base,
        motion=_motion(truth, step),
        frame_number=step,
        exposure_ev=_exposure_ev(renderer, camera_name, truth, step, run),
    )


def check_exposure(camera: MountedCamera, truth: Trajectory) -> None:
    """Refuse an exposure that has not ended when the next picture begins.

    Raises:
        RunError: naming camera, step, and what is wanted.
    """
    exposure_s = camera.sensor.degradation.exposure_s
    periods_s = np.diff(truth.times_s)
    if not np.any(periods_s < exposure_s):
        return
    step = int(np.argmin(periods_s))
    raise RunError(
        f"camera {camera.name!r}: degradation.shutter.exposure_s = {exposure_s:g}: want at most "
        f"{periods_s[step]:g} s, the time from step {step} to {step + 1}"
    )


def _motion(truth: Trajectory, step: int) -> PoseFunction:
    return lambda time_s: pose_at(truth, float(truth.times_s[step]) + time_s)


def _exposure_ev(
    renderer: Renderer, camera_name: str, truth: Trajectory, step: int, run: RunFolder
) -> float | None:
    """The exposure that auto-exposure has come to; None: settled on what it sees."""
    degradation = renderer.camera.degradation
    if step == 0 or degradation.exposure is None or not degradation.is_metered:
        return None
    before = _exposure_inside(run.file(camera_name, step - 1, ".png"))
    later_s = float(truth.times_s[step] - truth.times_s[step - 1])
    return degradation.exposure.next_ev(before["ev"], before["metered_ev"], later_s)


def _exposure_inside(path: Path) -> dict[str, Any]:
    try:
        _, metadata = read_image(path)
        told = (metadata or {})["degradation"]["exposure"]
        return {key: float(told[key]) for key in ("ev", "metered_ev")}
    except (OmnisimError, KeyError, TypeError, ValueError):
        raise RunError(
            f"{path}: does not tell its exposure, which the next picture's follows from: "
            "remove it, and it is taken again"
        ) from None
