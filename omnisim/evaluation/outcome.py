"""Outcome of an estimator on a run."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from omnisim.evaluation.camera_errors import CameraErrors
from omnisim.evaluation.trajectory_alignment import Alignment
from omnisim.evaluation.trajectory_errors import TrajectoryErrors

Status = Literal["ok", "not installed", "failed", "crashed", "timed out"]


@dataclass(frozen=True, eq=False)
class Outcome:
    """Outcome of an estimator on a run.

    Attributes:
        estimator: name of the estimator, or the user's command.
        status: "ok", or the kind of failure.
        reason: message of the failure, or the camera's errors in one line; empty: neither.
        seconds: time taken by the estimator, without starting its process; None: unknown.
        errors: errors of the trajectory; None: no trajectory.
        camera: errors of the calibrated camera; None: no calibration.
    """

    estimator: str
    status: Status
    reason: str = ""
    seconds: float | None = None
    errors: TrajectoryErrors | None = None
    camera: CameraErrors | None = None

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
