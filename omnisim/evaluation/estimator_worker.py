"""Process of one estimator: python -m omnisim.evaluation.estimator_worker RUN NAME FOLDER.

It writes `estimate.tum`, or `camera.json` for a calibration; then `done.json` with the time taken,
or with the reason of the failure.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from omnisim.cameras.calibration import calibration_of, save_calibration
from omnisim.core.errors import OmnisimError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.trajectory_files import write_trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator_registry import estimator_named

ESTIMATE, CAMERA, DONE = "estimate.tum", "camera.json", "done.json"


def main(run: Path, name: str, folder: Path) -> None:
    """Apply an estimator to a run, and write its estimate to a folder."""
    work = folder / "work"
    work.mkdir(exist_ok=True)
    done: dict[str, object]
    start_s = time.perf_counter()
    try:
        estimate = estimator_named(name).estimate(Recording.read(run), work)
        seconds = time.perf_counter() - start_s
        if isinstance(estimate, Trajectory):
            write_trajectory(folder / ESTIMATE, estimate)
        else:
            save_calibration(calibration_of(estimate), folder / CAMERA, "omnisim")
        done = {"seconds": seconds}
    except OmnisimError as reason:
        done = {"seconds": time.perf_counter() - start_s, "failure": str(reason)}
    write_text(folder / DONE, json.dumps(done))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
