"""User's command as an estimator."""

from __future__ import annotations

import shlex
import subprocess
from pathlib import Path

from omnisim.core.errors import EstimatorError, TrajectoryError
from omnisim.core.trajectories import Trajectory, read_trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import Estimator

_TAIL = 300  # characters of the command's errors in a message


class OwnCommand(Estimator):
    """Shell command that reads the run's folder {run} and writes a TUM file {out}.

    Raises:
        EstimatorError: the command lacks {run} or {out}.
    """

    title = "own command"
    is_repeatable = False

    def __init__(self, command: str):
        if "{run}" not in command or "{out}" not in command:
            raise EstimatorError(f"command {command!r}: expected {{run}} and {{out}} in it")
        self.command = command

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the base from the command's TUM file."""
        path = work / "estimate.tum"
        source = str(run.run.path.absolute())
        words = shlex.split(self.command)
        arguments = [word.replace("{run}", source).replace("{out}", str(path)) for word in words]
        try:
            done = subprocess.run(
                arguments, capture_output=True, text=True, errors="replace", cwd=work, check=False
            )
        except OSError as reason:
            raise EstimatorError(f"{arguments[0]}: cannot be run: {reason.strerror}") from None
        if done.returncode:
            tail = done.stderr.strip()[-_TAIL:] or "without a message"
            raise EstimatorError(f"{arguments[0]}: exit status {done.returncode}: {tail}")
        if not path.is_file():
            raise EstimatorError(f"{arguments[0]}: wrote no trajectory to {{out}}")
        try:
            return read_trajectory(path)
        except TrajectoryError as reason:
            raise EstimatorError(str(reason)) from None
