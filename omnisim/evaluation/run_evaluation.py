"""Estimators on a run: each in a process of its own, with a time limit, once."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from importlib import metadata
from pathlib import Path

from omnisim.cameras.calibration import load_calibration
from omnisim.core.errors import OmnisimError, OutputError
from omnisim.core.extras import install_hint, is_installed
from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.fingerprint import fingerprint
from omnisim.core.trajectories import read_trajectory
from omnisim.core.version import __version__
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.camera_errors import camera_errors
from omnisim.evaluation.estimator import Estimator
from omnisim.evaluation.estimator_registry import estimator_named
from omnisim.evaluation.estimator_worker import CAMERA, DONE, ESTIMATE
from omnisim.evaluation.outcome import Outcome, outcome_from
from omnisim.evaluation.trajectory_errors import trajectory_errors
from omnisim.runs.run_folder import MANIFEST

OUTCOME, OUTPUT = "outcome.json", "output.txt"
_TAIL = 200  # characters of a crashed process's last words
_FINAL = ("ok", "failed", "crashed")  # others may differ next time


def evaluate_estimator(run: Path, name: str, folder: Path, limit_s: float) -> Outcome:
    """Apply an estimator to a run, in a process of its own, and measure its errors.

    A stored outcome of the same run and estimator is read instead.

    Args:
        run: folder of a finished run.
        name: estimator, see `estimator_named`.
        folder: folder for its trajectory and outcome; created if missing.
        limit_s: time limit of the process.

    Raises:
        EstimatorError: the name is unknown.
        OmnisimError: the run cannot be read, or the folder cannot be written to.
    """
    estimator = estimator_named(name)
    manifest = (run / MANIFEST).read_text(encoding="utf-8")
    inputs = fingerprint(manifest, name, _version(estimator))
    before = _read_outcome(folder / OUTCOME, inputs)
    if before is not None:
        return before
    _make_folder(folder)
    if estimator.module and not is_installed(estimator.module):
        outcome = Outcome(name, "not installed", install_hint(estimator.extra))
    else:
        outcome = _estimate(run, name, folder, limit_s, estimator)
    content = {"inputs": inputs, **outcome.as_dict()}
    write_text(folder / OUTCOME, json.dumps(content, indent=2) + "\n")
    return outcome


def estimator_folder(name: str) -> str:
    """Name of an estimator's folder: its own, or a command's words and digest."""
    if re.fullmatch(r"[a-z0-9-]+", name):
        return name
    words = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[:30]
    return f"{words}-{fingerprint(name)[:6]}"


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{folder}: cannot be created: {reason.strerror}") from None


def _version(estimator: Estimator) -> str:
    """Versions of omnisim and of the estimator's package."""
    try:
        package = metadata.version(estimator.package) if estimator.package else ""
    except metadata.PackageNotFoundError:
        package = "none"
    return f"{__version__} {package}"


def _read_outcome(path: Path, inputs: str) -> Outcome | None:
    """Stored final outcome of the same inputs; None: missing."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content.pop("inputs") != inputs:
            return None
        outcome = outcome_from(content)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return outcome if outcome.status in _FINAL else None


def _estimate(run: Path, name: str, folder: Path, limit_s: float, estimator: Estimator) -> Outcome:
    """Run the process, and measure the errors of its trajectory."""
    for file in (ESTIMATE, CAMERA, DONE, OUTCOME):
        (folder / file).unlink(missing_ok=True)
    shutil.rmtree(folder / "work", ignore_errors=True)
    status = _run_worker(run, name, folder, limit_s)
    if status is None:
        return Outcome(name, "timed out", f"ended after {limit_s:g} s")
    try:
        done = json.loads((folder / DONE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return Outcome(name, "crashed", _last_words(folder / OUTPUT, status))
    shutil.rmtree(folder / "work", ignore_errors=True)
    if "failure" in done:
        return Outcome(name, "failed", done["failure"], done["seconds"])
    if (folder / CAMERA).is_file():
        return _camera_outcome(run, name, folder / CAMERA, done["seconds"])
    truth = Recording.read(run).fine_truth
    try:
        estimate = read_trajectory(folder / ESTIMATE)
        errors = trajectory_errors(estimate, truth, estimator.alignment)
    except OmnisimError as reason:
        return Outcome(name, "failed", str(reason), done["seconds"])
    return Outcome(name, "ok", "", done["seconds"], errors)


def _camera_outcome(run: Path, name: str, path: Path, seconds: float) -> Outcome:
    """Errors of a calibrated camera."""
    try:
        truth = LensCamera.of(Recording.read(run).cameras[0], lambda note: None).lens
        errors = camera_errors(load_calibration(path).camera().camera, truth)
    except OmnisimError as reason:
        return Outcome(name, "failed", str(reason), seconds)
    return Outcome(name, "ok", errors.summary, seconds, camera=errors)


def _run_worker(run: Path, name: str, folder: Path, limit_s: float) -> int | None:
    """Exit status of the process; None: timed out, and was killed with its children."""
    words = [sys.executable, "-m", "omnisim.evaluation.estimator_worker"]
    words += [str(run.absolute()), name, str(folder.absolute())]
    with (folder / OUTPUT).open("wb") as output:
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            start_new_session=True,
        )  # fmt: skip
        try:
            return process.wait(limit_s)
        except subprocess.TimeoutExpired:
            return None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def _last_words(path: Path, status: int) -> str:
    """Exit status or signal of a process, and the last line that it printed."""
    text = path.read_text(encoding="utf-8", errors="replace").strip()
    last = text.splitlines()[-1][-_TAIL:] if text else "without a message"
    ended = signal.Signals(-status).name if status < 0 else f"exit status {status}"
    return f"{ended}: {last}"
