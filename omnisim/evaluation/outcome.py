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
        estimator: its name, or the user's command.
        status: "ok" with errors, otherwise why there are none.
        reason: message of a failure, or errors of a camera in words; empty: none.
        seconds: time that the estimator took, without starting its process.
        errors: errors of its trajectory; None: it has none.
        camera: errors of its calibrated camera; None: it has none.
    """

    estimator: str
    status: Status
    reason: str = ""
    seconds: float | None = None
    errors: TrajectoryErrors | None = None
    camera: CameraErrors | None = None

    def as_dict(self) -> dict[str, Any]:
        """JSON object, read again by `outcome_from`."""
        content = dataclasses.asdict(self)
        if content["errors"] is not None:
            alignment = content["errors"]["alignment"]
            for key in ("rotation", "translation_m"):
                alignment[key] = alignment[key].tolist()
        return content


def outcome_from(content: dict[str, Any]) -> Outcome:
    """Outcome of a JSON object.

    Raises:
        KeyError, TypeError, ValueError: it is none.
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
