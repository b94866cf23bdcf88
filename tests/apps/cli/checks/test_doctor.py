"""`omnisim doctor`: what breaks is named, with a remedy, and the report holds no names."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from omnisim.apps.cli.checks import doctor as command
from omnisim.apps.cli.checks.doctor import DoctorStep, report, run_step, verdict
from omnisim.apps.doctor import (
    FAILED,
    LIMITS,
    OK,
    REFERENCES,
    STEPS,
    WARNING,
    Finding,
    scene_image,
)
from omnisim.core.files.image_files import write_image
from omnisim.core.package_files import SHADERS
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.scene import builtin_scenes
from tests.rendering.opengl.gl.older_libstdcxx import make_older_libstdcxx

BROKEN = "tests.apps.cli.checks.broken_steps"
FIRST = ("libraries", "devices", "OpenGL")
FINE = [DoctorStep(name, 1.0, Finding(OK, "Mesa, llvmpipe")) for name in STEPS]


def test_a_crash_is_named_with_its_place_and_a_variable_that_may_explain_it(monkeypatch):
    result = run_step("crashes", module=BROKEN).result
    assert result.status == FAILED
    assert re.match(r"the driver crashed \(SIGSEGV\) in .*, line \d+ in string_at", result.text)
    assert "update the graphics driver" in result.remedy
    monkeypatch.setenv("MESA_EXTENSION_OVERRIDE", "-GL_ARB_clip_control")
    result = run_step("crashes", module=BROKEN).result
    assert result.text.endswith(", with MESA_EXTENSION_OVERRIDE=-GL_ARB_clip_control")
    assert result.remedy == "unset MESA_EXTENSION_OVERRIDE"


def test_a_hang_ends_at_the_limit():
    step = run_step("hangs", module=BROKEN, limit_s=1.0)
    assert (step.result.status, step.result.text) == (FAILED, "not finished within 1 s")
    assert step.seconds < 10.0


def test_an_error_of_our_own_is_to_be_reported_and_what_a_driver_prints_is_named_once():
    result = run_step("raises", module=BROKEN).result
    assert result.text == "exit status 1: ValueError: no such thing"
    assert result.remedy == "report it, with --report FILE"
    step = run_step("prints", module=BROKEN)
    assert step.result.status == WARNING
    assert step.result.text == "prints 'MESA: warning: old'"
    assert step.result.remedy
    again = run_step("prints", known=step.output.splitlines(), module=BROKEN)
    assert again.result.status == OK


def test_the_verdict_says_what_works_and_what_to_do():
    assert verdict(FINE) == ["omnisim works here, in software: no GPU is used."]
    broken = [DoctorStep("libraries", 1.0, Finding(FAILED, "no EGL", "install it"))]
    assert verdict(broken) == [
        "OpenGL cannot be used here; --backend rays renders without it.", "To do: install it",
    ]  # fmt: skip
    wrong = Finding(FAILED, "wrong image", "update")
    some = [step._replace(result=wrong) if step.name == "soccer" else step for step in FINE]
    assert verdict(some) == ["OpenGL opens here, but steps fail: soccer.", "To do: update"]


def test_the_report_has_no_names(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", "/home/jane")
    monkeypatch.setenv("USER", "jane")
    monkeypatch.setattr(command.socket, "gethostname", lambda: "lab7")
    monkeypatch.chdir(tmp_path)
    said = f"{tmp_path}/a.png of jane on lab7; /home/jane/x; /home/joe/y: {sys.prefix}/lib"
    written = json.loads(report([DoctorStep("drive", 1.0, Finding(FAILED, said), said)], ["bad"]))
    expected = "<folder>/a.png of <user> on <host>; ~/x; /home/<user>/y: <python>/lib"
    assert written["steps"][0]["result"]["text"] == expected
    assert written["steps"][0]["output"] == expected
    assert written["verdict"] == ["bad"]
    assert "numpy" in written["installation"]["packages"]
    assert not re.search("jane|lab7|joe", json.dumps(written))


def test_the_command_stops_at_what_all_need_and_writes_its_report(omnisim, monkeypatch, tmp_path):
    ran = []

    def broken(name, device, known):
        ran.append((name, device))
        failed = Finding(FAILED, "OpenGL 3.3", "unset it")
        return DoctorStep(name, 1.0, failed if name == "OpenGL" else Finding(OK, "fine"))

    monkeypatch.setattr(command, "run_step", broken)
    status, text, _ = omnisim("doctor", "--device", "3", "--report", str(tmp_path / "r.json"))
    assert status == 1
    assert ran == [(name, 3) for name in FIRST]
    assert "failed   OpenGL         1.0 s  OpenGL 3.3: unset it" in text
    assert len(json.loads((tmp_path / "r.json").read_text())["steps"]) == 3


def test_a_report_that_cannot_be_written_ends_the_command_first(refused, monkeypatch):
    monkeypatch.setattr(command, "run_step", None)
    line = refused("doctor", "--report", "/proc/x.txt")
    assert line == "/proc/x.txt: the folder /proc cannot be written to"


def test_references_are_the_images_of_the_scenes(context):
    """To renew them: OMNISIM_RENEW_GOLDEN=1 pytest this file, and look at the image."""
    if "llvmpipe" not in graphics_info(context).renderer:
        pytest.skip("references are llvmpipe's")
    names = builtin_scenes()
    if os.environ.get("OMNISIM_RENEW_GOLDEN"):
        sheet = np.concatenate([scene_image(name)[0] for name in names], axis=1)
        write_image(REFERENCES, np.ascontiguousarray(sheet))
    assert STEPS["rings"](None).status == OK
    assert STEPS["soccer"](None).status == OK


def test_limits_suffice_for_the_shaders():
    bindings = [
        int(number)
        for path in SHADERS.rglob("*.*")
        for number in re.findall(r"std430, *binding = (\d+)", path.read_text(encoding="utf-8"))
    ]
    assert max(bindings) < LIMITS["GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS"]


# Before all else: EGL is not installed.
WITHOUT_EGL = """
import ctypes
class CDLL(ctypes.CDLL):
    def __init__(self, name, *rest, **more):
        if name and name.startswith("libEGL"):
            raise OSError(f"{name}: cannot open shared object file: No such file or directory")
        super().__init__(name, *rest, **more)
ctypes.CDLL = CDLL
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "environment", "status", "cause", "remedy"),
    [
        ("libraries", {"PYTHONPATH": "{0}"}, FAILED, "libEGL.so.1 is missing", "install OpenGL"),
        ("libraries", {"LIBGL_DRIVERS_PATH": "{0}"}, FAILED, "none of Mesa's drivers", "unset LIB"),
        (
            "libraries", {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent.json"}, FAILED,
            "names no driver's file", "unset __EGL_VENDOR_LIBRARY_FILENAMES",
        ),
        (
            "OpenGL", {"MESA_GL_VERSION_OVERRIDE": "3.3"}, FAILED,
            "OpenGL 4.5 or newer is needed", "unset MESA_GL_VERSION_OVERRIDE",
        ),
        (
            "libraries", {"MESA_SHADER_CACHE_DIR": "/proc/nothing"}, WARNING,
            "the cache of shaders cannot be written", "export MESA_SHADER_CACHE_DIR=FOLDER",
        ),
        ("libraries", {"LD_LIBRARY_PATH": "{0}"}, FAILED, "needs GLIBCXX_3.4.30", "out of LD_LIB"),
    ],
)  # fmt: skip
def test_broken_installations_are_named(
    context, monkeypatch, tmp_path, step, environment, status, cause, remedy
):
    if "Mesa 22" not in graphics_info(context).version:
        pytest.skip("of Mesa 22 it is known how to break it")
    if step == "libraries" and "LIBGL_DRIVERS_PATH" not in environment:
        (tmp_path / "sitecustomize.py").write_text(WITHOUT_EGL)
        make_older_libstdcxx(tmp_path)
    for name, value in environment.items():
        path = f":{os.pathsep.join(sys.path)}" if name == "PYTHONPATH" else ""
        monkeypatch.setenv(name, value.format(tmp_path) + path)
    result = run_step(step).result
    assert result.status == status, result
    assert cause in result.text
    assert remedy in result.remedy


@pytest.mark.slow
@pytest.mark.long
def test_all_steps_pass_here(needs_opengl, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "omnisim", "doctor", "--report", "r.json"],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    steps = json.loads((tmp_path / "r.json").read_text())["steps"]
    assert [step["name"] for step in steps] == list(STEPS)
    assert str(Path.cwd()) not in (tmp_path / "r.json").read_text()
