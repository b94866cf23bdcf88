"""Live page: image rate while driving, and latency from user input to image.

The server is the command itself, in its own process. The client requests the next image as soon as
it has received one, as the page does, but does not display it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from websockets.sync.client import ClientConnection, connect

from benchmarks.bounds import Limits, reaches_goal
from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.report import Judged, bound_lines, make_report
from omnisim.apps.live.live import page_bytes
from omnisim.plots import style
from omnisim.rendering.opengl.gl.context import open_context
from omnisim.report.machine import ROOT

SCENE, SIZE_PX = "soccer", 400
DRIVE_S = 3.0  # of each setting
VIEWS: dict[str, tuple[str, ...]] = {"one view": (), "panorama and range": ("panorama", "range")}
# Absolute times: bounds are five times slower than the slower of two processors, rounded.
_REASON = "five times slower than an EPYC with two cores: no machine on which the page is of use"
RATES = {
    "one view": Limits(bound=4.0, goal=12.0, at_least=True, reason=_REASON),
    "panorama and range": Limits(bound=1.5, goal=7.0, at_least=True, reason=_REASON),
}
KEY_MS = Limits(bound=500.0, goal=150.0, reason=_REASON)
MIRROR_MS = Limits(bound=1000.0, goal=400.0, reason=_REASON)
FIRST_S = Limits(bound=15.0, goal=2.5, reason=_REASON)
PAGE_KB = Limits(bound=200.0, reason="a size without noise; half of it is used")
_COMMAND = "from omnisim.apps.cli.app import main; main()"
_TIMEOUT_S = 60.0


def run(options: Options) -> dict[str, Any]:
    """Start the command, drive, press keys, and change the mirror.

    Raises:
        BenchmarkError: the command fails.
        OmnisimError: no OpenGL.
    """
    scene = options.scenes[0] if options.scenes else SCENE
    begin_s = time.perf_counter()
    with _served(scene, options) as client:
        client.frame()
        first_s = time.perf_counter() - begin_s
        client.rest()
        rates = {name: _rate(client, views) for name, views in VIEWS.items()}
        client.send("views", names=[])
        client.rest()
        keys = [_key_ms(client) for _ in _rounds(options, "key to image")]
        mirrors = [
            _mirror_ms(client, 8.0 + 0.1 * at) for at in _rounds(options, "change of the mirror")
        ]
    rows = [
        *({"what": name, "unit": "1/s", **rate} for name, rate in rates.items()),
        _row("key to image", keys),
        _row("change of the mirror", mirrors),
        {"what": "first image", "unit": "s", "value": first_s},
        {"what": "page", "unit": "kB", "value": page_bytes() / 1e3},
    ]
    context = open_context(options.device)
    report = make_report(
        "live", options, context, rows, _judged(rows), scene=scene, size_px=SIZE_PX
    )
    context.release()
    return report


def lines(report: dict[str, Any]) -> list[str]:
    """Text of the report."""
    text = [
        f"{row['what']:24} {row['value']:8.1f} {row['unit']}"
        + (f", {row['processor_ms']:.1f} ms of processor each" if "processor_ms" in row else "")
        for row in report["rows"]
    ]
    return text + bound_lines(report)


def figure(report: dict[str, Any]) -> Figure:
    """Figure of the values relative to their goals."""
    drawn, axes = style.plot(
        f"Live page, {report['scene']}, {report['size_px']}²", "times the goal", ""
    )
    entries = [entry for entry in report["bounds"] if entry["goal"] is not None]
    for at, entry in enumerate(entries):
        color = style.GREEN if reaches_goal(entry) else style.ORANGE
        axes.barh(at, entry["value"] / entry["goal"], color=color)
    axes.axvline(1.0, color=style.GRAY, linestyle="--")
    names = [f"{entry['name']}, {entry['sense']} {entry['goal']:g}" for entry in entries]
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    return drawn


class _Client:
    """Client that receives images without displaying them."""

    def __init__(self, socket: ClientConnection, process: int):
        self._socket, self._process = socket, process

    @property
    def processor_s(self) -> float:
        """Processor time of the server, all threads included."""
        text = Path(f"/proc/{self._process}/stat").read_text(encoding="utf-8")
        ticks = text.rpartition(")")[2].split()[11:13]
        return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")

    def send(self, message_type: str, /, **content: Any) -> None:
        """Send a message."""
        self._socket.send(json.dumps({"type": message_type, **content}))

    def frame(self) -> dict[str, Any]:
        """Request the next image, and wait for it.

        Raises:
            BenchmarkError: the server reports an error.
        """
        self.send("ask")
        while True:
            data = self._socket.recv(_TIMEOUT_S)
            assert isinstance(data, bytes)
            message: dict[str, Any] = json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])
            if message["type"] == "error":
                raise BenchmarkError(f"omnisim live: {message['text']}")
            if message["type"] == "frame":
                return message

    def rest(self) -> dict[str, Any]:
        """Wait for the fine image."""
        while not (frame := self.frame())["is_fine"]:
            pass
        return frame


@contextmanager
def _served(scene: str, options: Options) -> Iterator[_Client]:
    words = ["live", scene, "--size", str(SIZE_PX), "--port", "0"]
    if options.device is not None:
        words += ["--device", str(options.device)]
    with subprocess.Popen(
        [sys.executable, "-c", _COMMAND, *words], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            if not line.startswith("Open "):
                raise BenchmarkError(f"omnisim live: expected an address, got {line!r}")
            address = line.split()[1].replace("http", "ws", 1) + "stream"
            with connect(address, max_size=None, proxy=None) as socket:
                yield _Client(socket, process.pid)
        finally:
            process.terminate()


def _rounds(options: Options, what: str) -> Iterator[int]:
    return iter(options.progress(range(options.rounds), what, options.rounds))


def _rate(client: _Client, views: tuple[str, ...]) -> dict[str, float]:
    """Images per second while a key is held to drive in a circle, and processor time per image."""
    client.send("views", names=views)
    client.rest()
    count, begin_s, processor_s = 0, time.perf_counter(), client.processor_s
    while time.perf_counter() - begin_s < DRIVE_S:
        client.send("drive", ahead=0.5, turn=1.0)
        client.frame()
        count += 1
    seconds = time.perf_counter() - begin_s
    processor_s = client.processor_s - processor_s
    client.send("drive")
    client.rest()
    return {"value": count / seconds, "processor_ms": 1e3 * processor_s / count}


def _key_ms(client: _Client) -> float:
    """Milliseconds from a key press to the first image from another position."""
    client.send("turn", yaw_deg=1.0)  # or nothing new would be there to wait for
    before = client.rest()
    begin_s = time.perf_counter()
    client.send("drive", turn=1.0)
    while client.frame()["place"] == before["place"]:
        pass
    elapsed_ms = 1e3 * (time.perf_counter() - begin_s)
    client.send("drive")
    client.rest()
    return elapsed_ms


def _mirror_ms(client: _Client, k: float) -> float:
    """Milliseconds from a new mirror parameter to its image."""
    begin_s = time.perf_counter()
    client.send("set", path="sensor.mirror.k", value=k)
    client.frame()
    elapsed_ms = 1e3 * (time.perf_counter() - begin_s)
    client.rest()
    return elapsed_ms


def _row(what: str, times_ms: list[float]) -> dict[str, Any]:
    return {
        "what": what, "unit": "ms", "value": float(np.median(times_ms)),
        "p95": float(np.percentile(times_ms, 95.0)), "rounds": len(times_ms),
    }  # fmt: skip


def _judged(rows: list[dict[str, Any]]) -> list[Judged]:
    values = {row["what"]: float(row["value"]) for row in rows}
    return [
        *((f"images per second, {name}", values[name], limits) for name, limits in RATES.items()),
        ("key to image, median ms", values["key to image"], KEY_MS),
        ("change of the mirror, median ms", values["change of the mirror"], MIRROR_MS),
        ("command to first image, s", values["first image"], FIRST_S),
        ("page, kB", values["page"], PAGE_KB),
    ]
