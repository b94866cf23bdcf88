"""Broken installations of OpenGL, each in a process of its own: cause and remedy in one line.

The remedy is tried: with it, the same process renders.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import diagnosis
from omnisim.rendering.opengl.gl.context import graphics_info
from tests.rendering.opengl.gl.older_libstdcxx import make_older_libstdcxx

OPEN = "from omnisim.rendering.opengl.gl.context import open_context; open_context().release()"
CLEAN = {name: value for name, value in os.environ.items() if name not in diagnosis.VARIABLES}


def message(**environment):
    """Last line of the error of opening a context; empty: it opens."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.tracebacklimit = 0; {OPEN}"],
        env=CLEAN | environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.stderr.strip().rpartition("\n")[2].partition("GraphicsError: ")[2]


@pytest.fixture
def mesa(context):
    """Skip where the driver is not Mesa's software, which can be broken by variables."""
    if "llvmpipe" not in graphics_info(context).renderer:
        pytest.skip("only Mesa can be broken by variables")


@pytest.mark.parametrize("name", ["__EGL_VENDOR_LIBRARY_FILENAMES", "__EGL_VENDOR_LIBRARY_DIRS"])
def test_a_vendor_file_that_is_not_there_is_named(mesa, name):
    path = "/nonexistent.json"
    assert message(**{name: path}) == f"{name}={path} names no driver's file: unset {name}"


def test_an_empty_folder_of_drivers_is_named(mesa, tmp_path):
    if diagnosis._loaded("libgallium"):
        pytest.skip("this Mesa has all drivers in one library")
    said = message(LIBGL_DRIVERS_PATH=str(tmp_path))
    assert said.startswith(f"LIBGL_DRIVERS_PATH={tmp_path} has none of Mesa's drivers (")
    assert said.endswith("_dri.so): unset LIBGL_DRIVERS_PATH")


@pytest.mark.parametrize(
    ("variable", "value", "cause"),
    [
        ("MESA_GL_VERSION_OVERRIDE", "3.3", "has 3.3 (Core Profile) Mesa "),
        ("GALLIUM_DRIVER", "nonsense", "cannot be opened (eglInitialize failed (0x3001))"),
    ],
)
def test_an_override_is_named(mesa, variable, value, cause):
    said = message(**{variable: value})
    assert cause in said
    assert said.endswith(f", with {variable}={value}: unset {variable}")


def test_an_old_libstdcxx_before_mesas_is_named_and_the_system_s_helps(mesa, tmp_path):
    older = make_older_libstdcxx(tmp_path)
    said = message(LD_LIBRARY_PATH=str(tmp_path))
    if not said:
        pytest.skip("this Mesa needs no newer libstdc++")
    assert f"needs GLIBCXX_3.4.30, and {older} is older: take {tmp_path} out of" in said
    preload = said.rpartition("export LD_PRELOAD=")[2]
    assert message(LD_LIBRARY_PATH=str(tmp_path), LD_PRELOAD=preload) == ""


def test_a_library_that_does_not_load_is_named(mesa, tmp_path):
    (tmp_path / "libEGL.so.1").write_text("no library")
    said = message(LD_LIBRARY_PATH=str(tmp_path))
    assert said.startswith(f"libEGL.so.1 does not load ({tmp_path}/libEGL.so.1: file too short)")
    assert said.endswith(": unset LD_LIBRARY_PATH")


@pytest.mark.parametrize(
    ("system", "command"),
    [({"ID": "ubuntu", "ID_LIKE": "debian"}, "apt-get install"), ({"ID": "fedora"}, "dnf install")],
)
def test_missing_libraries_are_installed_by_the_system_s_packages(monkeypatch, system, command):
    monkeypatch.setattr(diagnosis.platform, "freedesktop_os_release", lambda: system)
    monkeypatch.setattr(
        diagnosis, "_load_error",
        lambda name: f"{name}: cannot open shared object file: No such file or directory",
    )  # fmt: skip
    with pytest.raises(GraphicsError, match=f"libEGL.so.1 is missing: .*{command}"):
        diagnosis.check_libraries()


@pytest.mark.parametrize(
    ("variables", "files", "error", "cause", "remedy"),
    [
        ({"LIBGL_ALWAYS_SOFTWARE": "1"}, ["/dev/dri/renderD128"], "", "hides", "unset LIBGL_ALW"),
        ({"NVIDIA_VISIBLE_DEVICES": "all"}, [], "", "and has none", "--gpus all"),
        ({"NVIDIA_VISIBLE_DEVICES": "all"}, ["/dev/nvidia0"], "x", "without OpenGL", "graphics"),
        ({}, ["/dev/nvidia0"], "x", "without OpenGL", "libnvidia-gl-"),
        ({}, ["/dev/nvidia0"], "", "does not know the NVIDIA driver", "libEGL_nvidia.so.0"),
        ({"__EGL_VENDOR_LIBRARY_FILENAMES": "/m"}, ["/dev/nvidia0"], "", "hides", "unset __EGL"),
    ],
)
def test_what_hides_an_nvidia_gpu_is_named(monkeypatch, variables, files, error, cause, remedy):
    for name in diagnosis.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    paths = [Path(file) for file in files]
    monkeypatch.setattr(
        Path, "glob", lambda folder, _: [path for path in paths if path.parent == folder]
    )
    monkeypatch.setattr(diagnosis.os, "access", lambda *_: True)
    monkeypatch.setattr(diagnosis.os.path, "exists", lambda _: False)
    monkeypatch.setattr(diagnosis, "_load_error", lambda _: error)
    fault = diagnosis.gpu_fault()
    assert cause in fault.cause
    assert remedy in fault.remedy


def test_a_cache_that_cannot_be_written_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("MESA_SHADER_CACHE_DIR", str(tmp_path))
    assert diagnosis.cache_fault() is None
    (tmp_path / "file").touch()
    monkeypatch.setenv("MESA_SHADER_CACHE_DIR", str(tmp_path / "file"))
    fault = diagnosis.cache_fault()
    assert fault.cause.startswith(f"{tmp_path / 'file'}: the cache of shaders cannot be written")
    assert fault.remedy.startswith("export MESA_SHADER_CACHE_DIR=")


def test_a_user_without_a_home_has_no_cache(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("MESA_SHADER_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(diagnosis.os.path, "expanduser", lambda path: path)  # as a container's user
    assert "this user has no home folder" in diagnosis.cache_fault().cause
    assert not list(tmp_path.iterdir())
