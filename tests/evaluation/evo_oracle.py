"""Errors of trajectories by evo, in a process of its own (evo is GPL).

As a program: python evo_oracle.py FOLDER, with `cases.json`, a list of [name, alignment], and
`<name>.truth.tum` and `<name>.estimate.tum` in the folder; it prints the errors as JSON.
"""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

MAX_OFFSET_S = 0.5e-3
TOLERANCE = 1e-9  # of meters and degrees, as asked for


def check_errors(folder, cases):
    """Compare our errors with evo's.

    Args:
        folder: folder for the trajectories.
        cases: estimate, truth and alignment, by name.
    """
    from omnisim.core.trajectories import read_trajectory
    from omnisim.core.trajectories.trajectory_files import write_trajectory
    from omnisim.evaluation.trajectory_errors import trajectory_errors

    if find_spec("evo") is None:
        pytest.skip("evo is not installed")
    ours = {}
    for name, (estimate, truth, kind) in cases.items():
        pair = []
        for what, trajectory in (("estimate", estimate), ("truth", truth)):
            file = folder / f"{name}.{what}.tum"
            write_trajectory(file, trajectory)
            pair.append(read_trajectory(file))  # both read the same digits
        ours[name] = trajectory_errors(*pair, kind)
    content = [[name, kind] for name, (_, _, kind) in cases.items()]
    (folder / "cases.json").write_text(json.dumps(content))
    done = subprocess.run(
        [sys.executable, __file__, str(folder)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    theirs = json.loads(done.stdout.splitlines()[-1])
    assert theirs.keys() == cases.keys()
    for name, expected in theirs.items():
        errors = ours[name]
        assert errors.poses == expected["poses"], name
        for key in ("ate_m", "rpe_m", "rpe_deg"):
            assert getattr(errors, key) == pytest.approx(expected[key], abs=TOLERANCE), (name, key)


def _main(folder):
    from evo.core import sync
    from evo.core.metrics import PoseRelation, Unit
    from evo.main_ape import ape
    from evo.main_rpe import rpe
    from evo.tools.file_interface import read_tum_trajectory_file

    results = {}
    for name, kind in json.loads((folder / "cases.json").read_text()):
        pair = [
            read_tum_trajectory_file(folder / f"{name}.{what}.tum")
            for what in ("truth", "estimate")
        ]
        truth, estimate = sync.associate_trajectories(*pair, max_diff=MAX_OFFSET_S)
        options = {"align": kind != "none", "correct_scale": kind == "sim3"}
        part, angle = PoseRelation.translation_part, PoseRelation.rotation_angle_deg
        step = {"delta": 1.0, "delta_unit": Unit.frames}
        results[name] = {
            "poses": estimate.num_poses,
            "ate_m": ape(truth, estimate, part, **options).stats["rmse"],
            "rpe_m": rpe(truth, estimate, part, **step, **options).stats["rmse"],
            "rpe_deg": rpe(truth, estimate, angle, **step, **options).stats["rmse"],
        }
    print(json.dumps(results))


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
