"""Work of the steps, each in its own process.

    python -m tests.drivers.gpu.steps FOLDER SCALE STEP [ARGUMENT ...]

A step writes `result.json` into the folder: `ok`, a line of text and numbers. It writes after each
part, so that a process that stalls leaves what it had. Frames that take longer than 100 ms are
counted, but for the first one, which compiles shaders. A frame that takes seconds ends the step.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.context import graphics_info, open_context
from omnisim.rendering.stage import Stage
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene, load_scene

CHECKOUT = Path(__file__).resolve().parents[3]
WAIT_S, STALL_S, STALLED = 0.1, 5.0, 3  # a wait, a stall, and the exit status after one
SCENE, SIZES_PX, BATCH_PX, BATCH = "soccer", (84, 360, 720), 84, 1024
MEASURE_S = 3.0  # at most, of each number of the speed
NO_RESULT = "ended without a result"
Result = dict[str, Any]


class Step:
    """Step that runs in this process, with a share of the images for a quick trial."""

    def __init__(self, folder: Path, scale: float):
        self.folder, self._scale = folder, scale
        self.result: Result = {"ok": True, "text": "", "waits": 0}

    def count(self, whole: int, least: int = 3) -> int:
        """Number of images, of `whole` without a scale."""
        return max(least, round(whole * self._scale))

    def seconds(self) -> float:
        """Time limit of one measurement of the speed."""
        return MEASURE_S * self._scale

    def save(self, **changes: Any) -> None:
        """Write the result so far."""
        self.result.update(changes)
        partial = self.folder / "result.partial"
        partial.write_text(json.dumps(self.result, indent=1), encoding="utf-8")
        partial.replace(self.folder / "result.json")

    def timed(self, what: str, work: Callable[[], Any], may_wait: bool) -> tuple[Any, float]:
        """Value and seconds of a piece of work; a stall ends the process.

        It may wait if it is more than a frame, or the first one, which compiles shaders.
        """
        start_s = time.monotonic()
        value = work()
        elapsed_s = time.monotonic() - start_s
        print(f"{what}: {1e3 * elapsed_s:.1f} ms", flush=True)
        if may_wait:
            return value, elapsed_s
        self.result["waits"] += elapsed_s > WAIT_S
        if elapsed_s > STALL_S:
            self.save(ok=False, text=f"stalled: {elapsed_s:.1f} s for {what}")
            os._exit(STALLED)  # without the driver's cleanup, which would wait, too
        return value, elapsed_s


def poses_at(scene: Scene, camera: OmniCamera, count: int) -> np.ndarray:
    """Poses (count, 4, 4) that turn and move on from the scene's start."""
    x, y, z = scene.start.position_m
    return np.stack(
        [
            camera.base_pose((x + 0.02 * k, y, z), yaw_deg=scene.start.yaw_deg + 20.0 * k)
            for k in range(count)
        ]
    )


def facts(step: Step) -> None:
    """Driver, kernel, limits and versions."""
    context = open_context()
    info = graphics_info(context)
    files = ("/proc/version", "/proc/driver/nvidia/version", "/proc/cpuinfo", "/etc/os-release")
    found = {name: Path(name).read_text("utf-8") for name in files if Path(name).is_file()}
    found["/proc/cpuinfo"] = found.get("/proc/cpuinfo", "").partition("\n\n")[0]
    prefixes = ("NVIDIA_", "CUDA_", "MESA_", "GALLIUM_", "LP_", "EGL_", "__EGL", "__GL", "LIBGL_")
    step.save(
        text=f"{info.renderer}, OpenGL {info.version}",
        info=context.info,
        extensions=sorted(context.extensions),
        files=found,
        devices=sorted(map(str, [*Path("/dev").glob("nvidia*"), *Path("/dev").glob("dri/*")])),
        nvidia_smi=_output("nvidia-smi"),
        nvidia_smi_query=_output("nvidia-smi", "-q"),
        commit=_output("git", "-C", str(CHECKOUT), "describe", "--always", "--dirty=+"),
        python=platform.python_version(),
        packages={name: version(name) for name in ("moderngl", "glcontext", "numpy")},
        environment={k: v for k, v in os.environ.items() if k.startswith(prefixes)},
    )


def buffers(step: Step, kind: str) -> None:
    """Buffers of a kind that processor and shaders take turns with."""
    from tests.drivers.gpu.buffers_step import take_turns
    from tests.drivers.gpu.variants import use_buffers

    use_buffers(kind)
    turns = take_turns()
    _, *later = turns["seconds"]
    is_right = not turns["wrong"] and turns["error"] == "GL_NO_ERROR"
    step.save(
        ok=is_right and max(later) < STALL_S,
        text=f"{turns['wrong']} wrong values, {turns['error']}, at most {1e3 * max(later):.1f} ms",
        waits=sum(seconds > WAIT_S for seconds in later),
        **turns,
    )


def sequence(step: Step, scene: str, variant: str) -> None:
    """Images one after the other, all poses twice."""
    from tests.drivers.gpu.variants import CHANGES, COPY_FIRST, copy_between_buffers, use_buffers

    kind, change = CHANGES[variant]
    use_buffers(kind)
    if change is not None:
        change()
    loaded, camera = load_scene(scene), OmniCamera().with_quality("fast").resized(360)
    poses = poses_at(loaded, camera, step.count(24))
    digests: list[str] = []
    seconds: list[float] = []
    with Stage(loaded) as stage, stage.open(camera) as renderer:
        if variant == COPY_FIRST:
            with stage.current():
                copy_between_buffers(stage.context)
        for number, pose in enumerate([*poses, *poses]):
            frame, elapsed_s = step.timed(
                f"image {number}", lambda pose=pose: renderer.render(pose), not number
            )
            digests.append(_digest(frame.rgb))
            seconds.append(elapsed_s)
            step.save(ok=False, text=f"ended after image {number}", digests=digests)
    unlike = sum(a != b for a, b in zip(digests, digests[len(poses) :], strict=False))
    text = f"{unlike} of {len(poses)} images unlike themselves, {_pace(seconds)}"
    step.save(ok=unlike == 0, text=text, seconds=seconds)


def case(step: Step, name: str) -> None:
    """Drawings of a case of the drivers' sample, for `python -m tests.drivers compare`."""
    from tests.drivers.cases import all_cases
    from tests.drivers.sample import sample_cases

    poses, size_px = step.count(4, least=1), 96
    cases = all_cases(size_px, poses) | sample_cases(size_px, poses)
    drawings, elapsed_s = step.timed(name, cases[name], may_wait=True)
    np.savez_compressed(step.folder / f"{name}.npz", **drawings)
    unlike, images = int(drawings["unlike itself"]), int(drawings["images"])
    step.save(
        ok=unlike == 0, text=f"{images} images, {unlike} unlike themselves", seconds=[elapsed_s]
    )


def drive(step: Step) -> None:
    """A robot's drive with camera and laser scanner, twice: the same files."""
    way = step.folder / "way.csv"
    legs = [(-1.0, 0.0), (0.5, 0.0), (0.5, 0.8), (-1.0, 0.8)]
    legs = legs[: step.count(len(legs), least=2)]
    way.write_text("x_m,y_m\n" + "".join(f"{x},{y}\n" for x, y in legs), encoding="utf-8")
    options = ("--robot", "p2at", "--path", str(way), "--size", "120", "--quality", "fast")
    files: list[dict[str, str]] = []
    seconds: list[float] = []
    for number in range(2):
        run = step.folder / f"run-{number}"
        command = [sys.executable, "-m", "omnisim", "drive", SCENE, *options, "-o", str(run)]
        start_s = time.monotonic()
        done = subprocess.run(command, cwd=CHECKOUT, check=False)
        seconds.append(time.monotonic() - start_s)
        if done.returncode:
            return step.save(ok=False, text=f"omnisim drive: exit status {done.returncode}")
        found = (path for path in sorted(run.rglob("*")) if path.is_file())
        files.append({str(path.relative_to(run)): _digest(path.read_bytes()) for path in found})
    first, again = files
    unlike = sum(again.get(name) != digest for name, digest in first.items())
    step.save(
        ok=first == again,
        text=f"{unlike} of {len(first)} files unlike themselves, {max(seconds):.1f} s each",
        seconds=seconds,
    )
    return None


def batches(step: Step) -> None:
    """A batch, and the same images and ranges one after the other."""
    scene, camera = load_scene(SCENE), OmniCamera().with_quality("fast").resized(BATCH_PX)
    poses = poses_at(scene, camera, step.count(64))
    names = ("rgb", "range", "instance")
    with Stage(scene) as stage, stage.open(camera) as renderer:
        unlike = 0
        for round_number in range(2):
            together, _ = step.timed(
                f"batch {round_number}",
                lambda: renderer.render_batch(poses, channels=names),
                may_wait=True,
            )
            for number, pose in enumerate(poses):
                frame, _ = step.timed(
                    f"image {number}",
                    lambda pose=pose: renderer.render(pose, also=names[1:]),
                    may_wait=not number,
                )
                alone = {"rgb": frame.rgb, **frame.channels}
                unlike += any(
                    together[name][number].tobytes() != alone[name].tobytes() for name in names
                )
    step.save(ok=unlike == 0, text=f"{unlike} of {2 * len(poses)} images unlike those of the batch")


def in_turn(step: Step) -> None:
    """Images and scans of one robot in turn, at poses that come again."""
    vehicle, scene = Vehicle.load("p2at"), load_scene(SCENE)
    mounted = vehicle.camera()
    camera = mounted.sensor.with_quality("fast").resized(360)
    poses = poses_at(scene, camera, 10)
    seen: dict[tuple[str, int], str] = {}
    seconds: list[float] = []
    unlike, images = 0, step.count(300)
    with (
        Stage(scene, vehicle.body) as stage,
        stage.open(camera, hidden=mounted.hides) as renderer,
        stage.open(vehicle.scanner()) as scanner,
    ):
        for number in range(images + images // 3):
            pose = number % len(poses)
            what, work = "image", lambda pose=pose: renderer.render(poses[pose]).rgb
            if number % 4 == 3:
                what, work = "scan", lambda pose=pose: scanner.scan(poses[pose]).ranges_m
            value, elapsed_s = step.timed(f"{what} {number}", work, number < 4)
            unlike += seen.setdefault((what, pose), _digest(value)) != _digest(value)
            seconds.append(elapsed_s)
            if number % 20 == 0:
                step.save(ok=False, text=f"ended after measurement {number}")
    text = f"{unlike} of {len(seconds)} unlike themselves, {_pace(seconds)}"
    step.save(ok=unlike == 0, text=text, seconds=seconds)


def speed(step: Step, quality: str) -> None:
    """Images and ground truth, one after the other, by size."""
    scene = load_scene(SCENE)
    rows: list[Result] = []
    with Stage(scene) as stage:
        for size_px in SIZES_PX:
            camera = OmniCamera().with_quality(quality).resized(size_px)
            poses = poses_at(scene, camera, 24)
            with stage.open(camera) as renderer:
                for what, channels in (("image", ()), ("ground truth", ("range", "instance"))):
                    rows.append(
                        _measured(
                            step,
                            f"{what}, {size_px}² {quality}",
                            lambda pose, also=channels: renderer.render(pose, also=also),
                            poses,
                        )
                    )
                    step.save(text=f"{len(rows)} numbers", rows=rows)


def scans_and_batches(step: Step) -> None:
    """Scans of a laser scanner and a lidar, and images in batches."""
    from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
    from omnisim.sensors.lidar.spinning_lidar import SpinningLidar

    scene, camera = load_scene(SCENE), OmniCamera().with_quality("fast").resized(BATCH_PX)
    poses, rows = poses_at(scene, camera, 24), []
    with Stage(scene) as stage:
        for what, sensor in (("laser scan", LaserScanner()), ("lidar scan", SpinningLidar())):
            with stage.open(sensor) as renderer:
                rows.append(_measured(step, what, renderer.scan, poses))
                step.save(text=f"{len(rows)} numbers", rows=rows)
        for count in (64, step.count(BATCH)):
            many = np.resize(poses, (count, 4, 4))
            with stage.open(camera) as renderer:
                out = renderer.render_batch(many)  # its atlas is allocated then
                row = _measured(
                    step,
                    f"batch of {count} × {BATCH_PX}²",
                    lambda _, many=many, out=out: renderer.render_batch(many, out=out),
                    poses,
                    images=count,
                )
                rows.append(row)
                step.save(text=f"{len(rows)} numbers", rows=rows)


def fig_10(step: Step, scene: str) -> None:
    """The paper's Fig. 10 in one of its maps."""
    from benchmarks.options import Options
    from benchmarks.suites import fps

    fps.MAX_SECONDS = 8.0 * step.seconds()
    report = fps.run(Options(warm_up=2, scenes=(scene,)))
    (step.folder / "fps.json").write_text(json.dumps(report), encoding="utf-8")
    print("\n".join(fps.lines(report)), flush=True)
    ratios = ", ".join(f"{entry['value']:.3f}" for entry in report["bounds"])
    step.save(ok=report["passed"], text=f"{fps.RATIO_NAME}: {ratios}")


STEPS = (facts, buffers, sequence, case, drive, batches, in_turn, speed, scans_and_batches, fig_10)


def main(folder: str, scale: str, name: str, *arguments: str) -> None:
    """Run a step; exit status 1 if its result is not as it should be."""
    step = Step(Path(folder), float(scale))
    step.save(ok=False, text=NO_RESULT)
    step.result["ok"] = True
    steps = {one.__name__.replace("_", " "): one for one in STEPS}
    steps[name](step, *arguments)
    sys.exit(not step.result["ok"])


def _measured(
    step: Step, what: str, work: Callable[[np.ndarray], Any], poses: np.ndarray, images: int = 1
) -> Result:
    """Median time of a piece of work, for as long as a measurement may take."""
    seconds: list[float] = []
    waits, is_batch = step.result["waits"], images > 1
    if not is_batch:
        step.timed(what, lambda: work(poses[0]), may_wait=True)
    for pose in _while(step.seconds(), poses, least=1 if is_batch else 3):
        _, elapsed_s = step.timed(what, lambda pose=pose: work(pose), may_wait=is_batch)
        seconds.append(elapsed_s)
    middle_s = float(np.median(seconds))
    return {
        "what": what, "rounds": len(seconds), "median_ms": 1e3 * middle_s,
        "p99_ms": 1e3 * float(np.percentile(seconds, 99)), "max_ms": 1e3 * max(seconds),
        "per_second": images / middle_s, "waits": step.result["waits"] - waits,
    }  # fmt: skip


def _while(seconds: float, poses: np.ndarray, least: int, most: int = 500) -> Iterator[Any]:
    """Poses, again and again, until the time is over."""
    end_s = time.monotonic() + seconds
    for number in range(most):
        if number >= least and time.monotonic() > end_s:
            return
        yield poses[number % len(poses)]


def _pace(seconds: list[float]) -> str:
    later = seconds[1:]
    return f"median {1e3 * float(np.median(later)):.1f} ms, at most {1e3 * max(later):.1f} ms"


def _digest(content: np.ndarray | bytes) -> str:
    return hashlib.sha1(content if isinstance(content, bytes) else content.tobytes()).hexdigest()


def _output(*command: str) -> str:
    """Output of a command; why there is none."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10.0)
    except (OSError, subprocess.TimeoutExpired) as reason:
        return str(reason)
    return (done.stdout + done.stderr).strip()


if __name__ == "__main__":
    main(*sys.argv[1:])
