"""Check of a graphics card: run to its end by llvmpipe with few images, and what it reports."""

import ctypes
import json
import os
import subprocess
import sys
import tarfile

import numpy as np
import pytest

from omnisim.rendering.opengl.gl import buffers
from omnisim.rendering.opengl.gl.functions import gl_function
from tests.drivers.gpu import buffers_step, plan, steps
from tests.drivers.gpu.plan import Outcome, PlannedStep, check_gpu, chosen_steps, summary_lines
from tests.drivers.gpu.variants import HINTS, use_buffers
from tests.drivers.processes import CHECKOUT, LLVMPIPE

STEPS = (
    "facts", "buffers", "sequence rings", "case rings", "drive twice", "batches", "in turn",
    "scans and batches", "variant static hints", "variant buffers copy",
)  # fmt: skip
IMMUTABLE_STORAGE, USAGE = 0x821F, 0x8765


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.long
def test_it_runs_to_its_end(tmp_path):
    out = tmp_path / "gpu.tar"
    command = [sys.executable, "-m", "tests.drivers", "gpu", "--out", str(out), "--only", *STEPS]
    done = subprocess.run(
        [*command, "--scale", "0.02"], cwd=CHECKOUT, env={**os.environ, **LLVMPIPE},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    with tarfile.open(out) as tar:
        # Debian 12's Python has no filters yet
        tar.extractall(tmp_path, **{"filter": "data"} if hasattr(tarfile, "data_filter") else {})
    outcomes = json.loads((tmp_path / "summary.json").read_text("utf-8"))
    assert [outcome["name"] for outcome in outcomes] == list(STEPS)
    assert [
        outcome["name"] for outcome in outcomes if outcome["verdict"] != "ok" or outcome["health"]
    ] == []
    assert (tmp_path / "summary.txt").read_text("utf-8") in done.stdout
    results = {
        path.parent.name: json.loads(path.read_text("utf-8"))
        for path in tmp_path.glob("*/result.json")
    }
    assert len(results) == len(STEPS)
    assert "llvmpipe" in results["00-facts"]["text"]
    assert "Linux" in results["00-facts"]["files"]["/proc/version"]
    digests = results["02-sequence-rings"]["digests"]
    assert len(digests) == 6
    assert digests[:3] == digests[3:]
    with np.load(tmp_path / "cases" / "rings.npz") as drawn:
        assert drawn["rgb"].shape == (1, 96, 96, 3)
    assert [row["what"] for row in results["07-scans-and-batches"]["rows"]] == [
        "laser scan", "lidar scan", "batch of 64 × 84²", "batch of 20 × 84²"
    ]  # fmt: skip


def test_steps_without_time_are_skipped_and_say_so(tmp_path):
    out, lines = tmp_path / "gpu.tar", []
    assert check_gpu(out, 0.0, ["facts", "case soccer"], print_line=lines.append)
    assert sum("skipped    facts: no time left" in line for line in lines) == 1
    assert any("case soccer: no time left" in line for line in lines)
    with tarfile.open(out) as tar:
        assert tar.getnames() == ["summary.txt", "summary.json"]


def test_risky_steps_come_last_and_names_are_beginnings():
    steps = chosen_steps(())
    risky = [step.may_fail for step in steps]
    assert risky == sorted(risky)
    assert len({step.name for step in steps}) == len(steps) > 40
    assert [step.name for step in chosen_steps(["speed", "fig"])] == [
        "speed fast", "speed default", "fig 10 soccer", "fig 10 mapping"
    ]  # fmt: skip
    with pytest.raises(ValueError, match="no step begins with 'spede': expected some of facts"):
        chosen_steps(["spede"])


def test_a_step_that_fails_says_why_and_a_risky_one_is_no_failure(tmp_path, monkeypatch):
    statuses = iter([1, 0, None, 1])

    def process(module, output, limit_s):
        is_health = module == ("tests.drivers.gpu.health",)
        output.write_text("AssertionError: 12.0 s for three reads\n" if is_health else "why\n")
        return next(statuses)

    monkeypatch.setattr(plan, "_process", process)
    failed = plan._run(PlannedStep("a", ("x",)), tmp_path, 9.0, 1.0)
    assert (failed.verdict, failed.text, failed.health) == ("FAILED", "exit status 1: why", "")
    late = plan._run(PlannedStep("b", ("x",), 9.0, may_fail=True), tmp_path, 9.0, 1.0)
    assert (late.verdict, late.health) == ("timed out", "AssertionError: 12.0 s for three reads")
    assert late.text.startswith("not finished after 9 s")
    monkeypatch.setattr(plan, "_process", lambda *_: None)
    assert plan._run(PlannedStep("c", ("x",), 9.0), tmp_path, 8.0, 1.0).verdict == "cut short"


def test_a_frame_that_stalls_ends_its_step_with_what_there_is(tmp_path, monkeypatch):
    def leave(status):
        raise SystemExit(status)

    step = steps.Step(tmp_path, scale=1.0)
    monkeypatch.setattr(steps, "WAIT_S", 0.0)
    assert step.timed("image 0", lambda: 7, may_wait=True)[0] == 7
    assert step.timed("image 1", lambda: 8, may_wait=False)[0] == 8
    assert step.result["waits"] == 1
    monkeypatch.setattr(steps, "STALL_S", 0.0)
    monkeypatch.setattr(steps.os, "_exit", leave)
    with pytest.raises(SystemExit, match=str(steps.STALLED)):
        step.timed("image 2", lambda: 9, may_wait=False)
    result = json.loads((tmp_path / "result.json").read_text("utf-8"))
    assert result["ok"] is False
    assert result["text"].startswith("stalled: ")


def test_a_process_is_killed_at_its_limit(tmp_path):
    sleep = ("timeit", "-n", "1", "-r", "1", "-s", "import time", "time.sleep(60)")
    assert plan._process(sleep, tmp_path / "output.txt", 0.3) is None
    assert plan._process(("timeit", "-n", "1"), tmp_path / "output.txt", 60.0) == 0


def test_the_summary_names_illness_and_new_lines_of_the_kernel():
    speed = {"what": "image, 84² fast", "per_second": 1000.0, "median_ms": 1.0, "p99_ms": 2.0,
             "max_ms": 200.0, "waits": 1}  # fmt: skip
    lines = summary_lines(
        [
            Outcome("a", "ok", "fine", 2.0, 1.0, waits=1, rows=[speed]),
            Outcome("b", "FAILED", "so", 3.0, health="no answer", kernel=["NVRM: Xid 31"]),
        ]
    )
    assert lines[1].split() == ["a", "ok", "2.0", "1", "well", "fine"]
    assert lines[2].split() == ["b", "FAILED", "3.0", "0", "ill", "so"]
    assert lines[3:5] == ["b: no answer", "b: kernel: NVRM: Xid 31"]
    assert lines[-3].endswith("1      ≥ 2000: 2 × off")
    assert lines[-1] == "5 s, 1 s of the processor; 1 frames over 100 ms"


def _parameter(buffer, name):
    value = ctypes.c_int()
    get = gl_function("glGetNamedBufferParameteriv", ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p)
    get(buffer.glo, name, ctypes.addressof(value))
    return value.value


@pytest.mark.parametrize("kind", HINTS)
def test_buffers_are_mutable_with_the_hints_of_a_variant(kind, context, monkeypatch):
    monkeypatch.setattr(buffers, "gl_function", gl_function)
    assert _parameter(buffers.gpu_buffer(context, 64), IMMUTABLE_STORAGE) == 1
    use_buffers(kind)
    made = (
        buffers.gpu_buffer(context, 64),
        buffers.gpu_buffer(context, bytes(64)),
        buffers.written_buffer(context, 64),
    )
    assert [_parameter(buffer, IMMUTABLE_STORAGE) for buffer in made] == [0, 0, 0]
    static, dynamic, copied = 0x88E4, 0x88E8, 0x88EA
    assert [_parameter(buffer, USAGE) for buffer in made] == {
        "dynamic": [static, static, dynamic],
        "static": [static, static, static],
        "copy": [copied, static, dynamic],
    }[kind]
    made[2].write(b"12")
    assert buffers.read_buffer(made[2])[:2] == b"12"


@pytest.mark.usefixtures("needs_opengl")
def test_the_buffers_step_notices_a_wrong_command(monkeypatch):
    right = buffers_step.take_turns()
    assert (right["wrong"], right["error"]) == (0, "GL_NO_ERROR")
    bent = buffers_step.PREPARE.replace("3u * number, 0u", "3u * (number / 2u), 0u")
    assert bent != buffers_step.PREPARE
    monkeypatch.setattr(buffers_step, "PREPARE", bent)
    assert buffers_step.take_turns()["wrong"] > 1000
