"""Steps of `omnisim doctor`; `python -m omnisim.apps.doctor STEP FILE [DEVICE]` runs one.

Each has a process of its own, since a driver may crash or hang, and writes its result as JSON.
"""

from __future__ import annotations

import faulthandler
import json
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import GraphicsError, OmnisimError
from omnisim.core.extras import require_opengl
from omnisim.core.files.image_files import read_image
from omnisim.core.trajectories.trajectory import Trajectory
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.report.machine import is_software
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import builtin_scenes, load_scene
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner

OK, WARNING, FAILED = "ok", "warning", "failed"
REFERENCES = Path(__file__).with_name("doctor.png")  # of llvmpipe, scene beside scene
IMAGE_PX = 32  # of a reference
CAMERA = OmniCamera().resized(84).with_quality("fast")
# Bounds on an image's mean difference from its reference in levels, and on the share of pixels
# that differ by more than 24 levels: versions of llvmpipe move single pixels on edges, other
# drivers also filter textures with other roundings.
BOUNDS = {True: (0.25, 0.005), False: (1.0, 0.03)}  # by whether llvmpipe renders
LIMITS = {  # limits of OpenGL
    "GL_MAX_TEXTURE_SIZE": 16384,
    "GL_MAX_ARRAY_TEXTURE_LAYERS": 256,
    "GL_MAX_SHADER_STORAGE_BLOCK_SIZE": 1 << 24,
    "GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS": 16,
    "GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS": 8,
    "GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS": 12,
    "GL_MAX_CLIP_DISTANCES": 8,
}
FASTER = {  # extensions without which there is a slower way
    "GL_ARB_indirect_parameters", "GL_ARB_shader_draw_parameters",
    "GL_ARB_shader_viewport_layer_array",
}  # fmt: skip
FRAMES, BATCH, RATE_S, MAX_WAIT_S = 24, 64, 1.0, 2.0
LIMIT_S = 60.0  # of a step
OTHER_DRIVER = "update the graphics driver, or choose another --device"
CHANNELS = ("range", "instance", "semantic", "normals")


class Finding(NamedTuple):
    """Result of a step: `OK`, `WARNING` or `FAILED`, its cause, what to do, and numbers."""

    status: str
    text: str
    remedy: str = ""
    details: Mapping[str, Any] = {}


def main() -> None:
    """Run a step and write its result."""
    faulthandler.enable()  # prints where it crashes or waits
    faulthandler.dump_traceback_later(0.9 * LIMIT_S)
    warnings.simplefilter("ignore")  # notices of scenes
    name, file, *device = sys.argv[1:]
    try:
        result = STEPS[name](int(device[0]) if device else None)
    except GraphicsError as error:
        result = Finding(FAILED, error.cause, error.remedy)
    except OmnisimError as error:
        result = Finding(FAILED, str(error))
    Path(file).write_text(json.dumps(result._asdict()), encoding="utf-8")


def _libraries(_: int | None) -> Finding:
    require_opengl("omnisim")
    from omnisim.rendering.opengl.gl.diagnosis import cache_fault, check_libraries, driver_fault

    check_libraries()
    if fault := driver_fault():
        return Finding(FAILED, *fault)
    if fault := cache_fault():
        return Finding(WARNING, *fault)
    return Finding(OK, "EGL, OpenGL and a driver load; shaders are cached")


def _devices(_: int | None) -> Finding:
    from omnisim.rendering.opengl.gl.context import list_devices
    from omnisim.rendering.opengl.gl.diagnosis import cuda_numbers, gpu_fault

    texts, faults, has_gpu = [], [], False
    for (number, opened), cuda in zip(list_devices(), cuda_numbers(), strict=True):
        name = f"{number}" if cuda is None else f"{number} (cuda:{cuda})"
        if isinstance(opened, GraphicsError):
            texts.append(f"{name} does not open: {opened.cause}")
            faults.append(opened.remedy)
        else:
            texts.append(f"{name}: {opened.renderer}")
            has_gpu |= not is_software(opened.renderer)
    if not has_gpu and (fault := gpu_fault()):
        texts.append(fault.cause)
        faults.append(fault.remedy)
    status = OK if not faults else FAILED if len(faults) >= len(texts) else WARNING
    return Finding(status, "; ".join(texts), faults[-1] if faults else "")


def _opengl(device: int | None) -> Finding:
    from omnisim.rendering.opengl.gl.context import graphics_info, open_context

    context = open_context(device)
    opened, info = graphics_info(context), context.info
    limits = {name: info[name] for name in LIMITS}
    details = {**opened._asdict(), "limits": limits}
    text = f"{opened.version}, {opened.renderer}"
    if lacking := [f"{name}={limits[name]}" for name in LIMITS if limits[name] < LIMITS[name]]:
        return Finding(FAILED, f"{text}; too small: {' '.join(lacking)}", OTHER_DRIVER, details)
    if missing := ", ".join(sorted(FASTER - context.extensions)):
        return Finding(WARNING, f"{text}; slow without {missing}", "update the driver", details)
    return Finding(OK, text, details=details)


def scene_image(name: str, device: int | None = None) -> tuple[Bytes, str]:
    """Image (32, 32, 3) of a built-in scene from its start, and the renderer's name."""
    with Stage(name, device=device) as stage, stage.open(OmniCamera().resized(IMAGE_PX)) as camera:
        return camera.render(_poses(camera, 1)[0]).rgb, stage.backend.renderer


def _scene(name: str, device: int | None) -> Finding:
    image, renderer = scene_image(name, device)
    left = IMAGE_PX * builtin_scenes().index(name)
    reference = read_image(REFERENCES)[0][:, left : left + IMAGE_PX]
    off = np.abs(image.astype(int) - reference)
    mean, share = float(off.mean()), float((off.max(axis=-1) > 24).mean())
    max_mean, max_share = BOUNDS["llvmpipe" in renderer]
    details = {"mean": mean, "share": share}
    text = f"{mean:.2f} levels off; {share:.1%} of pixels by more than 24"
    if mean <= max_mean and share <= max_share:
        return Finding(OK, text, details=details)
    text = f"wrong image: {text} (bounds: {max_mean}, {max_share:.1%})"
    return Finding(FAILED, text, OTHER_DRIVER, details | {"image": image.tobytes().hex()})


def _images(what: str, channels: Sequence[str], device: int | None) -> Finding:
    with open_sensor("soccer", CAMERA, device=device) as camera:
        poses = _poses(camera, FRAMES)

        def draw(number: int) -> bytes:
            frame = camera.render(poses[number], also=channels)
            return b"".join(image.tobytes() for image in (frame.rgb, *frame.channels.values()))

        return _twice(what, draw, FRAMES)


def _batches(device: int | None) -> Finding:
    with open_sensor("soccer", CAMERA, device=device) as camera:
        poses = _poses(camera, FRAMES)
        single = b"".join(camera.render(pose).rgb.tobytes() for pose in poses)
        if single != camera.render_batch(poses).tobytes():
            return Finding(FAILED, "a batch differs from single images", OTHER_DRIVER)
        return _twice("batches", lambda first: camera.render_batch(poses[first:]).tobytes(), 4)


def _drive(device: int | None) -> Finding:
    vehicle = Vehicle.load("p2at").with_cameras(size_px=84, quality="fast")
    drive = Drive(load_scene("soccer"), vehicle, Route("lap_clockwise"), device=device)
    truth, steps = drive.plan().truth, 4
    first = slice(steps + 1)
    planned = drive.along(Trajectory(truth.times_s[first], truth.world_from_base[first]))
    with tempfile.TemporaryDirectory() as folder:
        runs = {run: planned.record(run) for run in (Path(folder, "a"), Path(folder, "b"))}
        for steps_done in runs.values():
            next(steps_done)  # opens the sensors
            next(steps_done)  # compiles their shaders
        order = [run for run in runs for _ in range(steps)]

        def draw(_: int) -> bytes:
            run = order.pop(0)
            next(runs[run])
            files = (file for file in sorted(run.rglob("*")) if file.suffix in (".png", ".csv"))
            return b"".join(file.read_bytes() for file in files)

        result = _twice("steps of a drive", draw, steps)
        for steps_done in runs.values():
            list(steps_done)  # closes the sensors
        return result


def _rates(device: int | None) -> Finding:
    with Stage("soccer", device=device) as stage:
        camera = stage.open(CAMERA)
        poses = _poses(camera, BATCH)
        base, scanner = poses[0], stage.open(LaserScanner())
        rates = {
            "images/s": _rate(lambda: camera.render(base)),
            "images/s in batches": BATCH * _rate(lambda: camera.render_batch(poses)),
            "scans/s": _rate(lambda: scanner.scan(base)),
        }
    text = ", ".join(f"{rate:.0f} {name}" for name, rate in rates.items())
    return Finding(OK, f"{text} (soccer, 84 × 84 px)", details=rates)


def _rate(draw: Callable[[], object]) -> float:
    """Calls per second, after the first."""
    draw()
    start_s, count = time.perf_counter(), 0
    while time.perf_counter() - start_s < RATE_S:
        draw()
        count += 1
    return count / (time.perf_counter() - start_s)


def _twice(what: str, draw: Callable[[int], bytes], count: int) -> Finding:
    """Draw everything twice: it must be the same, and none may wait."""
    drawn, times_s = [], []
    for number in (*range(count), *range(count)):
        start_s = time.perf_counter()
        drawn.append(draw(number))
        times_s.append(time.perf_counter() - start_s)
    differ = sum(first != again for first, again in zip(drawn, drawn[count:], strict=False))
    median_s, slowest_s = float(np.median(times_s)), max(times_s[1:])
    details = {"differ": differ, "times_s": [round(time_s, 4) for time_s in times_s]}
    if differ:
        return Finding(FAILED, f"{differ} of {count} {what} differ", OTHER_DRIVER, details)
    text = f"{count} {what} twice, identical; {1e3 * median_s:.0f} ms each"
    if slowest_s > max(MAX_WAIT_S, 10.0 * median_s):
        return Finding(FAILED, f"{text}, but {slowest_s:.1f} s for one", OTHER_DRIVER, details)
    return Finding(OK, f"{text}, at most {1e3 * slowest_s:.0f} ms", details=details)


def _poses(camera: Renderer, count: int) -> Floats:
    """Poses (count, 4, 4) of the base, turning around the scene's start."""
    start = camera.scene.start
    turns = (start.yaw_deg + 15.0 * number for number in range(count))
    return np.stack([camera.camera.base_pose(start.position_m, yaw_deg=turn) for turn in turns])


STEPS: dict[str, Callable[[int | None], Finding]] = {
    "libraries": _libraries,
    "devices": _devices,
    "OpenGL": _opengl,
    **{name: partial(_scene, name) for name in builtin_scenes()},
    "sequence": partial(_images, "images", ()),
    "batches": _batches,
    "ground truth": partial(_images, "images with ground truth", CHANNELS),
    "drive": _drive,
    "rates": _rates,
}

if __name__ == "__main__":
    main()
