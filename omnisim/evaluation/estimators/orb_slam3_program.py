"""Process of ORB-SLAM3: python orb_slam3_program.py FOLDER < IMAGES.

The license of `pyorbslam3` is the GPL. Nothing of omnisim is therefore imported here; the two
programs exchange files and a pipe. FOLDER has `request.json`, `settings.yaml`, the vocabulary,
`times.npy` (n,) in s and, with an IMU, `imu.npy` (m, 7): time in s, angular rate in rad/s, specific
force in m/s². The pipe carries n frames of one or two 8-bit gray images. The results are
`frames.txt` and `keyframes.txt`, in EuRoC's format.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

REQUEST, SETTINGS, TIMES, IMU = "request.json", "settings.yaml", "times.npy", "imu.npy"
FRAMES, KEYFRAMES = "frames.txt", "keyframes.txt"
IDLE_CHECKS, CHECK_S, MAX_WAIT_S = 4, 1.5e-3, 5.0  # the mapping thread sleeps 3 ms at a time
MAX_POLL_NS = 100_000  # processor time of a thread that looks for work and finds none


class Slices(NamedTuple):
    """Slices of processor time of a thread: their sum in ns and number, and the last one's kind."""

    used_ns: int
    number: int
    is_long: bool


def main(folder: Path) -> None:
    """Track all frames, and write the trajectory of the largest map."""
    request = json.loads((folder / REQUEST).read_text(encoding="utf-8"))
    import pyorbslam3  # type: ignore[import-untyped]

    times_s = np.load(folder / TIMES)
    readings = np.load(folder / IMU) if (folder / IMU).is_file() else None
    size, cameras = (request["height_px"], request["width_px"]), request["cameras"]
    kind = ("IMU_" if readings is not None else "") + ("STEREO" if cameras == 2 else "MONOCULAR")
    sensor = pyorbslam3.Sensor.__members__[kind]
    slam = pyorbslam3.Slam(request["vocabulary"], folder / SETTINGS, sensor)
    track = slam.track_stereo if cameras == 2 else slam.track_monocular
    last_s, has_map = times_s[0] - 1.0 / request["fps"], False
    for time_s in times_s:
        raw = sys.stdin.buffer.read(cameras * size[0] * size[1])
        images = np.frombuffer(raw, np.uint8).reshape(cameras, *size)
        imu = None
        if readings is not None:
            imu = readings[(readings[:, 0] > last_s) & (readings[:, 0] <= time_s)]
        has_map |= track(*images, float(time_s), imu=imu).ok
        last_s = time_s
        wait_for_mapping()
    slam.shutdown()
    if has_map:  # without a keyframe the library saves from a pointer that it has not set
        slam.save_trajectory_euroc(str(folder / FRAMES))
        slam.save_keyframe_trajectory_euroc(str(folder / KEYFRAMES))
    sys.stdout.flush()
    os._exit(0)  # the library's own destructors crash


def wait_for_mapping() -> None:
    """Wait until all other threads are idle, so that the map is independent of the load."""
    end_s, idle = time.monotonic() + MAX_WAIT_S, 0
    seen: dict[str, Slices] = {}
    own = str(threading.get_native_id())
    while idle < IDLE_CHECKS and time.monotonic() < end_s:
        time.sleep(CHECK_S)
        tasks = [task for task in Path("/proc/self/task").iterdir() if task.name != own]
        busy = [_is_busy(task, seen) for task in tasks]
        idle = 0 if any(busy) else idle + 1


def _is_busy(task: Path, seen: dict[str, Slices]) -> bool:
    """True if a thread works, or waits for a processor in order to work.

    A thread without work wakes every 3 ms, and finds none. On a loaded machine it nearly always
    waits for a processor, too, but its slices of processor time are short.
    """
    try:
        state = (task / "stat").read_text().rpartition(")")[2].split()[0]
        used_ns, _, number = map(int, (task / "schedstat").read_text().split())
    except (OSError, ValueError):  # the thread has ended
        return False
    last = seen.get(task.name, Slices(used_ns, number, True))
    is_long = last.is_long
    if number > last.number:
        is_long = used_ns - last.used_ns > MAX_POLL_NS * (number - last.number)
    seen[task.name] = Slices(used_ns, number, is_long)
    return state in "RD" and is_long


if __name__ == "__main__":
    main(Path(sys.argv[1]))
