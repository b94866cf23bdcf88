"""Evaluation of an estimator on a run: in its own process, with a time limit, and cached."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import signal
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

import numpy as np

from omnisim.cameras.calibration import load_calibration
from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError
from omnisim.core.extras import install_hint, is_installed
from omnisim.core.files.atomic_file import make_folder, write_text
from omnisim.core.files.sources import fingerprint
from omnisim.core.trajectories import Trajectory, read_trajectory
from omnisim.core.version import __version__
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.child_process import ChildProcesses
from omnisim.evaluation.estimator import Estimator
from omnisim.evaluation.estimator_registry import estimator_named
from omnisim.evaluation.estimator_worker import CAMERA, DONE, ESTIMATE
from omnisim.evaluation.trajectory_errors import (
    Alignment,
    CameraErrors,
    TrajectoryErrors,
    camera_errors,
    match_times,
    trajectory_errors,
)
from omnisim.runs.run_folder import MANIFEST

OUTCOME, OUTPUT = "outcome.json", "output.txt"
MAX_GAP_S = 0.11  # between two recorded states; a spline bridges no longer gap
_TAIL = 200  # characters of a crashed process's last line


def evaluate_estimator(
    run: Path,
    name: str,
    folder: Path,
    limit_s: float,
    *,
    given: Path | None = None,
    children: ChildProcesses | None = None,
) -> Outcome:
    """Apply an estimator to a run, in its own process, and measure its errors.

    If the folder has an outcome of the same run and estimator, it is returned instead, unless it is
    a failure that may not recur: a crash, a time limit, or one of an estimator that is not
    repeatable.

    Args:
        run: folder of a finished run with the true calibration.
        name: name of the estimator, see `estimator_named`.
        folder: folder for the estimate and the outcome; created if missing.
        limit_s: time limit of the process.
        given: folder of the run as the estimator gets it, perhaps miscalibrated; None: `run`.
        children: child processes to start and end; None: only this one.

    Raises:
        EstimatorError: the name is unknown.
        OmnisimError: the run cannot be read, or the folder cannot be written to.
    """
    estimator = estimator_named(name)
    manifest = (run / MANIFEST).read_text(encoding="utf-8")
    given = given or run
    label = "" if given == run else given.name  # has the digest of the calibration's errors
    inputs = fingerprint(manifest, name, _version(estimator), label)
    before = _read_outcome(folder / OUTCOME, inputs)
    if before is not None and (
        before.status == "ok" or (before.status == "failed" and estimator.is_repeatable)
    ):  # another attempt would have the same outcome
        return before
    make_folder(folder)
    if estimator.module and not is_installed(estimator.module):
        outcome = Outcome(name, "not installed", install_hint(estimator.extra))
    else:
        status = _run_worker(given, name, folder, limit_s, children or ChildProcesses())
        outcome = _outcome(run, name, folder, limit_s, estimator, status)
    content = {"inputs": inputs, **outcome.as_dict()}
    write_text(folder / OUTCOME, json.dumps(content, indent=2) + "\n")
    return outcome


def estimator_folder(name: str) -> str:
    """Folder name of an estimator: its name, or the words of a command and their digest."""
    if re.fullmatch(r"[a-z0-9-]+", name):
        return name
    words = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[:30]
    return f"{words}-{fingerprint(name)[:6]}"


def _version(estimator: Estimator) -> str:
    """Versions of omnisim and of the estimator's package."""
    try:
        package = metadata.version(estimator.package) if estimator.package else ""
    except metadata.PackageNotFoundError:
        package = "none"
    return f"{__version__} {package}"


def _read_outcome(path: Path, inputs: str) -> Outcome | None:
    """Cached outcome of the same inputs; None: there is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content.pop("inputs") != inputs:
            return None
        return outcome_from(content)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _run_worker(
    given: Path, name: str, folder: Path, limit_s: float, children: ChildProcesses
) -> int | None:
    """Run the estimator's process; returns its exit status, or None after the time limit."""
    for file in (ESTIMATE, CAMERA, DONE, OUTCOME):
        (folder / file).unlink(missing_ok=True)
    shutil.rmtree(folder / "work", ignore_errors=True)
    arguments = [str(given.absolute()), name, str(folder.absolute())]
    with (folder / OUTPUT).open("wb") as output:
        return children.run("omnisim.evaluation.estimator_worker", arguments, output, limit_s)


def _outcome(
    run: Path, name: str, folder: Path, limit_s: float, estimator: Estimator, status: int | None
) -> Outcome:
    """Outcome of an ended process, with the errors of its trajectory or camera."""
    if status is None:
        return Outcome(name, "timed out", f"ended after {limit_s:g} s")
    try:
        done = json.loads((folder / DONE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        text = (folder / OUTPUT).read_text(encoding="utf-8", errors="replace").strip()
        last = text.splitlines()[-1][-_TAIL:] if text else "without a message"
        ended = signal.Signals(-status).name if status < 0 else f"exit status {status}"
        return Outcome(name, "crashed", f"{ended}: {last}")
    shutil.rmtree(folder / "work", ignore_errors=True)
    if "failure" in done:
        return Outcome(name, "failed", done["failure"], done["seconds"])
    recording = Recording.read(run)
    try:
        if (folder / CAMERA).is_file():
            lens = LensCamera.of(recording.cameras[0], lambda note: None).lens
            camera = camera_errors(load_calibration(folder / CAMERA).camera().camera, lens)
            return Outcome(name, "ok", camera.summary, done["seconds"], camera=camera)
        estimate = read_trajectory(folder / ESTIMATE)
        truth = true_trajectory(recording, estimate.times_s)
        tracked = truth.world_from_base @ estimator.base_from_tracked(recording)
        truth = Trajectory(truth.times_s, tracked)
        errors = trajectory_errors(estimate, truth, estimator.alignment)
    except OmnisimError as reason:
        return Outcome(name, "failed", str(reason), done["seconds"])
    return Outcome(name, "ok", "", done["seconds"], errors)


def true_trajectory(recording: Recording, times_s: Floats) -> Trajectory:
    """True poses at all recorded states, and at further times (n,) where they can be interpolated.

    A time that is farther than `MAX_OFFSET_S` from all recorded states, such as a stamp with an
    error, gets the pose of a spline if it lies between two states at most `MAX_GAP_S` apart.
    """
    truth = recording.fine_truth
    used, _ = match_times(times_s, truth.times_s)
    other_s = np.delete(times_s, used)
    after = np.searchsorted(truth.times_s, other_s)
    inside = (after > 0) & (after < len(truth.times_s))
    gaps_s = truth.times_s[after[inside]] - truth.times_s[after[inside] - 1]
    other_s = np.unique(other_s[inside][gaps_s <= MAX_GAP_S])
    if not len(other_s):
        return truth
    poses = recording.states(other_s).world_from_base
    times = np.concatenate((truth.times_s, other_s))
    order = np.argsort(times)
    return Trajectory(times[order], np.concatenate((truth.world_from_base, poses))[order])


Status = Literal["ok", "not installed", "failed", "crashed", "timed out"]


@dataclass(frozen=True, eq=False)
class Outcome:
    """Outcome of an estimator on a run."""

    estimator: str  # name of the estimator, or the user's command
    status: Status  # "ok", or the kind of failure
    reason: str = ""  # message of the failure, or the camera's errors in one line; empty: neither
    # time taken by the estimator, without starting its process; None: unknown
    seconds: float | None = None
    errors: TrajectoryErrors | None = None  # errors of the trajectory; None: no trajectory
    camera: CameraErrors | None = None  # errors of the calibrated camera; None: no calibration

    def as_dict(self) -> dict[str, Any]:
        """JSON object that `outcome_from` reads."""
        content = dataclasses.asdict(self)
        if content["errors"] is not None:
            alignment = content["errors"]["alignment"]
            for key in ("rotation", "translation_m"):
                alignment[key] = alignment[key].tolist()
        return content


def outcome_from(content: dict[str, Any]) -> Outcome:
    """Outcome from its JSON object.

    Raises:
        KeyError, TypeError, ValueError: not the JSON object of an outcome.
    """
    errors = content["errors"]
    if errors is not None:
        given = errors["alignment"]
        alignment = Alignment(
            np.array(given["rotation"], dtype=np.float64),
            np.array(given["translation_m"], dtype=np.float64),
            float(given["scale"]),
        )
        errors = TrajectoryErrors(**{**errors, "alignment": alignment})
    camera = content.get("camera")
    camera = None if camera is None else CameraErrors(**camera)
    return Outcome(**{**content, "errors": errors, "camera": camera})
