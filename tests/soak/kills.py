"""Drives that are killed at random moments and resumed: the bytes of an undisturbed run.

Two robots and an object move in one world; one of the robots has a sensor of each type.
"""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from omnisim.core.package_files import SCENES
from omnisim.sensors.sensor_registry import SENSOR_TYPES

DRIVE = (
    "drive", "match.toml", "--robot", "all.toml", "--path", "lap", "--robot", "superscout",
    "--path", "lap_clockwise", "--size", "32", "--step", "3", "--turn-step", "90",
    "--quality", "fast", "--seed", "7", "--also", "instance",
)  # fmt: skip
SCENE = """
extends = "soccer"
[[objects]]
name = "box"
file = "box.obj"
shuttle = { from_m = [-1.0, -1.0, 0.2], to_m = [1.0, 1.0, 0.2], period_s = 9.0 }
"""
BOX = "v 0 0 0\nv 0.3 0 0\nv 0 0.3 0\nv 0 0 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
MAIN = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from omnisim.apps.cli.start import main; main()"
)
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
MAX_S = 600.0


def contents(folder: Path) -> dict[str, bytes]:
    """Bytes of all files under a folder, by their relative paths."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def write_inputs(folder: Path) -> None:
    """Write a scene with a moving object, and a robot with a sensor of each type."""
    (folder / "match.toml").write_text(SCENE)
    (folder / "box.obj").write_text(BOX)
    robot = (SCENES / "p2at" / "robot.toml").read_text(encoding="utf-8").partition("[[sensors]]")[0]
    sensors = [
        f'[[sensors]]\nname = "{kind}"\ntype = "{kind}"\nposition_m = [0.0, 0.0, {1.0 + 0.1 * k}]\n'
        for k, kind in enumerate(SENSOR_TYPES)
    ]
    (folder / "all.toml").write_text(robot.replace('body = "p2at.glb"\n', "") + "".join(sensors))


def start(folder: Path) -> subprocess.Popen[str]:
    """Begin or resume the drive into `folder`."""
    return subprocess.Popen(
        [sys.executable, "-c", MAIN, *DRIVE, "-o", str(folder)],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder.parent,
    )  # fmt: skip


def finish(folder: Path) -> None:
    """Drive to the end."""
    process = start(folder)
    _, errors = process.communicate(timeout=MAX_S)
    if process.returncode != 0:
        raise RuntimeError(f"{folder}: exit status {process.returncode}: {errors}")


def kill(folder: Path, moments: random.Random, duration_s: float, files: int) -> int | None:
    """Resume a drive and kill it at a random moment, by time or by the number of its files.

    Returns:
        Files that were there at the moment, or None: the drive had ended before.
    """
    there = _count(folder)
    wanted = there + moments.randint(1, max(1, files - there))
    process = start(folder)
    by_files = moments.random() < 0.5
    until = time.monotonic() + (MAX_S if by_files else moments.uniform(0.0, duration_s))
    while process.poll() is None and time.monotonic() < until:
        if by_files and _count(folder) >= wanted:
            time.sleep(moments.uniform(0.0, 0.05))
            break
        time.sleep(0.005)
    is_running = process.poll() is None
    process.send_signal(moments.choice(SIGNALS))
    process.communicate()
    return _count(folder) if is_running else None


def _count(folder: Path) -> int:
    """Number of files under a folder, which may not be there."""
    return sum(path.is_file() for path in folder.rglob("*"))


def kills(folder: Path, times: int, seed: int, print_line=print) -> None:
    """Kill drives `times` times; a run is driven to its end after some, and compared.

    Raises:
        RuntimeError: a run that does not end, or with other bytes; it stays in the folder.
    """
    write_inputs(folder)
    moments, begun = random.Random(seed), time.monotonic()
    finish(folder / "whole")
    duration_s = time.monotonic() - begun
    whole, done, runs, at = contents(folder / "whole"), 0, 0, []
    while done < times:
        run = folder / f"run-{runs}"
        for _ in range(min(moments.randint(1, 8), times - done)):
            files = kill(run, moments, duration_s, len(whole))
            if files is None:
                break
            at.append(files)
            done += 1
        finish(run)
        found = contents(run)
        different = sorted(
            name for name in whole.keys() | found.keys() if whole.get(name) != found.get(name)
        )
        if different:
            raise RuntimeError(f"{run}: differs after kills in {', '.join(different[:5])}")
        for name in sorted(found, reverse=True):
            (run / name).unlink()
        runs += 1
        print_line(
            f"{done} of {times} kills, {runs} runs equal; "
            f"killed with {min(at, default=0)} to {max(at, default=0)} files"
        )
