"""Causes why OpenGL does not work or is slow, each with its remedy.

No context is opened: libraries, drivers' files, variables and device files are examined. EGL's
loader (libglvnd) reads the vendors' files, which name the drivers' libraries; Mesa before 24.3 then
loads another library per kind of GPU.
"""

from __future__ import annotations

import ctypes
import json
import os
import platform
import re
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from omnisim.core.errors import GraphicsError

LIBRARIES = ("libEGL.so.1", "libGL.so.1")
_VENDOR_FILES, _VENDOR_FOLDERS = "__EGL_VENDOR_LIBRARY_FILENAMES", "__EGL_VENDOR_LIBRARY_DIRS"
_SYSTEM_VENDORS = Path("/usr/share/glvnd/egl_vendor.d")
# Variables that replace the driver, or the version and extensions that it states.
_OVERRIDES = (
    "MESA_GL_VERSION_OVERRIDE", "MESA_GLSL_VERSION_OVERRIDE", "MESA_EXTENSION_OVERRIDE",
    "GALLIUM_DRIVER", "MESA_LOADER_DRIVER_OVERRIDE",
)  # fmt: skip
VARIABLES = (
    *_OVERRIDES, _VENDOR_FILES, _VENDOR_FOLDERS, "LIBGL_ALWAYS_SOFTWARE", "LIBGL_DRIVERS_PATH",
    "GLCONTEXT_DEVICE_INDEX", "LD_LIBRARY_PATH", "LD_PRELOAD", "CONDA_PREFIX",
    "NVIDIA_VISIBLE_DEVICES", "NVIDIA_DRIVER_CAPABILITIES", "CUDA_VISIBLE_DEVICES",
    "MESA_SHADER_CACHE_DIR", "XDG_CACHE_HOME",
)  # fmt: skip
_PACKAGES = {  # by the distribution, or the one that it is like
    "debian": "apt-get install libegl1 libgl1 libgl1-mesa-dri",
    "fedora": "dnf install mesa-libEGL mesa-libGL mesa-dri-drivers",
    "arch": "pacman -S mesa libglvnd",
    "suse": "zypper install Mesa-libEGL1 Mesa-libGL1 Mesa-dri",
}
_NVIDIA = "libEGL_nvidia.so.0"
_NVIDIA_FILE = '{"file_format_version": "1.0.0", "ICD": {"library_path": "libEGL_nvidia.so.0"}}'
_LIBRARY_FOLDERS = ("/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/lib64")


class Fault(NamedTuple):
    """Cause of a failure, and its remedy."""

    cause: str
    remedy: str


def check_libraries() -> None:
    """Check that the libraries of EGL and OpenGL load.

    Raises:
        GraphicsError: one does not; with its remedy.
    """
    for library in LIBRARIES:
        if fault := _load_fault(library):
            raise GraphicsError(*fault)


def driver_fault() -> Fault | None:
    """Fault of the drivers' files and libraries; None: at least one driver loads."""
    library = _loaded("libEGL.so")
    if library is None or _loaded("libGLdispatch.so") is None:  # not libglvnd's: reads no files
        return nvidia_fault()
    prefix = str(library.resolve()).partition("/lib")[0]
    folders = [Path(folder, "glvnd/egl_vendor.d") for folder in ("/etc", f"{prefix}/share")]
    files, variable = _vendor_files(*folders)
    if not files and variable:
        remedy = f"unset {variable}" + ("" if _files_in(*folders) else f", and {install_hint()}")
        return Fault(f"{variable}={os.environ[variable]} names no driver's file", remedy)
    if not files and _SYSTEM_VENDORS not in folders and _files_in(_SYSTEM_VENDORS):
        cause = f"{library} is not the system's, and finds no OpenGL driver"
        return Fault(cause, f"export {_VENDOR_FOLDERS}={_SYSTEM_VENDORS}")
    if not files:
        return nvidia_fault() or Fault("there is no OpenGL driver", install_hint())
    faults = [_vendor_fault(file) for file in files]
    return None if None in faults else faults[0]


def version_fault(required: str, version: str, renderer: str) -> Fault:
    """Fault of a driver whose OpenGL is too old.

    Args:
        required: needed version, such as 4.5.
        version, renderer: OpenGL's strings of the driver; empty: unknown.
    """
    offered = f"{renderer} has {version}" if version else "the driver has an older one"
    cause = f"OpenGL {required} or newer is needed, and {offered}"
    is_software = any(name in renderer for name in ("llvmpipe", "softpipe", "swrast"))
    remedy = "update Mesa to 20.3 or newer, with LLVM" if is_software else "update the driver"
    return override_fault(cause) or Fault(
        cause, remedy + ("" if is_software else ", or render in software: LIBGL_ALWAYS_SOFTWARE=1")
    )


def open_fault(message: str) -> Fault:
    """Fault behind EGL's message that no device can be opened."""
    cause = f"the OpenGL driver cannot be opened ({message})"
    fault = driver_fault() or override_fault(cause) or gpu_fault()
    return fault or Fault(cause, "update it, or render in software: LIBGL_ALWAYS_SOFTWARE=1")


def override_fault(cause: str) -> Fault | None:
    """Fault with a cause that variables may explain, if any of them is set."""
    names = [name for name in _OVERRIDES if name in os.environ]
    values = ", ".join(f"{name}={os.environ[name]}" for name in names)
    return Fault(f"{cause}, with {values}", f"unset {' '.join(names)}") if names else None


def gpu_fault() -> Fault | None:
    """Fault that hides a GPU from OpenGL, whether software renders or not."""
    nodes = sorted(Path("/dev/dri").glob("renderD*"))
    for node in [*nodes, *_nvidia_cards()]:
        if not os.access(node, os.R_OK | os.W_OK):
            remedy = "sudo usermod -aG render,video $USER, and log in again"
            return Fault(f"{node}: this user has no access to the GPU", remedy)
    if nodes and (name := "LIBGL_ALWAYS_SOFTWARE") in os.environ:
        return Fault(f"{name}={os.environ[name]} hides {nodes[0]}", f"unset {name}")
    return nvidia_fault()


def nvidia_fault() -> Fault | None:
    """Fault that hides an NVIDIA GPU of this machine or container from EGL."""
    is_asked_for = os.environ.get("NVIDIA_VISIBLE_DEVICES", "void") not in ("", "void", "none")
    driver = Path("/proc/driver/nvidia/version")
    start = "start the container with --gpus all -e NVIDIA_DRIVER_CAPABILITIES=all"
    if not _nvidia_cards():
        fault = Fault(
            "this container is for NVIDIA GPUs, and has none", f"{start}, if there is one"
        )
        return fault if is_asked_for or driver.exists() else None
    if error := _load_error(_NVIDIA):
        cause = f"the NVIDIA driver is here without OpenGL ({error})"
        if is_asked_for or any(map(os.path.exists, ("/.dockerenv", "/run/.containerenv"))):
            return Fault(cause, f"{start} ('graphics' is missing)")
        number = re.search(r" (\d+)\.[\d.]+ ", driver.read_text() if driver.exists() else "")
        package = f"libnvidia-gl-{number[1] if number else '<version>'}"
        return Fault(cause, f"install {package}, of the same version as the driver")
    files, variable = _vendor_files(Path("/etc/glvnd/egl_vendor.d"), _SYSTEM_VENDORS)
    if any(_NVIDIA in _vendor_library(file) for file in files):
        return None
    if variable:
        return Fault(f"{variable}={os.environ[variable]} hides the NVIDIA GPU", f"unset {variable}")
    file = _SYSTEM_VENDORS / "10_nvidia.json"
    return Fault(f"EGL does not know the NVIDIA driver: no {file}", f"write {_NVIDIA_FILE} to it")


def _nvidia_cards() -> list[Path]:
    return sorted(Path("/dev").glob("nvidia[0-9]*"))


def cache_fault() -> Fault | None:
    """Fault of the folder where the driver caches compiled shaders."""
    is_nvidia = any(_nvidia_cards()) and not nvidia_fault()
    variable = "__GL_SHADER_DISK_CACHE_PATH" if is_nvidia else "MESA_SHADER_CACHE_DIR"
    usual = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(os.environ.get(variable) or usual)
    try:
        if folder.parts[0] == "~":
            raise FileNotFoundError(0, "this user has no home folder")
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as reason:
        cause = f"{folder}: the cache of shaders cannot be written ({reason.strerror})"
        remedy = f"export {variable}=FOLDER, a folder that can be written"
        return Fault(f"{cause}; each start compiles all of them", remedy)
    return None


def printed_fault(line: str) -> Fault:
    """Fault behind a line that a driver printed although it works."""
    fault = cache_fault() if "cache" in line else driver_fault() or gpu_fault()
    remedy = fault.remedy if fault else "nothing, if no step fails: EGL_LOG_LEVEL=fatal hides it"
    return Fault(f"prints {line.strip()!r}", remedy)


def install_hint() -> str:
    """Command that installs software OpenGL on this distribution."""
    try:
        system = platform.freedesktop_os_release()
    except OSError:
        system = {}
    names = [system.get("ID", ""), *system.get("ID_LIKE", "").split()]
    command = next((_PACKAGES[name] for name in names if name in _PACKAGES), _PACKAGES["debian"])
    sudo = "sudo " if os.geteuid() else ""
    return f"install OpenGL: {sudo}{command} (software), or your graphics card's driver"


def _vendor_fault(file: Path) -> Fault | None:
    """Fault of the driver that a vendor's file names."""
    library = _vendor_library(file)
    if not library:
        return Fault(f"{file} names no driver's library", "install the driver again")
    if fault := _load_fault(library):
        return (nvidia_fault() if _NVIDIA in library else None) or fault
    mesa = _loaded("libEGL_mesa.so")
    if mesa is None or "mesa" not in library or _loaded("libgallium") is not None:
        return None
    variable = os.environ.get("LIBGL_DRIVERS_PATH")
    folders = variable.split(":") if variable else [str(mesa.parent / "dri"), "/usr/lib/dri"]
    kind = "*_dri.so" if any(Path("/dev/dri").glob("renderD*")) else "swrast_dri.so"
    drivers = [str(driver) for folder in folders for driver in Path(folder).glob(kind)]
    if drivers:  # in software, if there is one
        return _load_fault(max(drivers, key=lambda driver: driver.endswith("/swrast_dri.so")))
    if variable:
        cause = f"LIBGL_DRIVERS_PATH={variable} has none of Mesa's drivers ({kind})"
        return Fault(cause, "unset LIBGL_DRIVERS_PATH")
    return Fault(f"there is no OpenGL driver, no {kind} in {folders[0]}", install_hint())


def _load_fault(library: str) -> Fault | None:
    """Fault of a shared library that does not load."""
    error = _load_error(library)
    if not error:
        return None
    if mismatch := re.match(r"(.*): version `(\w+?)_([\d.]+)' not found.*by (.*)\)", error):
        older, kind, version, newer = mismatch.groups()
        cause = f"OpenGL's {Path(newer).name} needs {kind}_{version}, and {older} is older"
        systems = (Path(folder, Path(older).name) for folder in _LIBRARY_FOLDERS)
        system = next((str(path) for path in systems if path.exists()), "")
        if kind == "GLIBC" or system in ("", os.path.realpath(older)):
            return Fault(cause, "use a newer distribution or base image")
        folder = os.path.dirname(older)
        is_listed = folder in os.environ.get("LD_LIBRARY_PATH", "").split(":")
        other = f"take {folder} out of LD_LIBRARY_PATH" if is_listed else "update libstdcxx-ng"
        return Fault(cause, f"{other}, or put the system's first: export LD_PRELOAD={system}")
    if "No such file" in error:
        return Fault(f"{error.partition(':')[0]} is missing", install_hint())
    paths = [name for name in ("LD_LIBRARY_PATH", "LD_PRELOAD") if os.environ.get(name)]
    remedy = f"unset {' '.join(paths)}" if paths else install_hint()
    return Fault(f"{library} does not load ({error})", remedy)


def _load_error(library: str) -> str:
    """Loader's message about a shared library; empty: it loads."""
    try:
        ctypes.CDLL(library)
    except OSError as reason:
        return str(reason)
    return ""


def _loaded(name: str) -> Path | None:
    """Path of a library in this process, by the beginning of its name."""
    maps = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace")
    found = re.search(rf"\s(/.*/{re.escape(name)}[^/\n]*)$", maps, re.MULTILINE)
    return Path(found[1]) if found else None


def _vendor_files(*folders: Path) -> tuple[list[Path], str]:
    """Vendors' files that EGL reads, and the variable that names them; empty: the usual folders."""
    if listed := os.environ.get(_VENDOR_FILES):
        return [path for word in listed.split(":") if (path := Path(word)).is_file()], _VENDOR_FILES
    if listed := os.environ.get(_VENDOR_FOLDERS):
        return _files_in(*map(Path, listed.split(":"))), _VENDOR_FOLDERS
    return _files_in(*folders), ""


def _files_in(*folders: Path) -> list[Path]:
    return [file for folder in folders for file in sorted(folder.glob("*.json"))]


def _vendor_library(file: Path) -> str:
    """Driver's library in a vendor's file; empty: it names none."""
    try:
        return str(json.loads(file.read_text(encoding="utf-8"))["ICD"]["library_path"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


# EGL's devices, and their numbers in CUDA.
MAX_DEVICES = 64  # more than any machine has
_EXTENSIONS, _CUDA_DEVICE = 0x3055, 0x323A  # EGL_EXTENSIONS, EGL_CUDA_DEVICE_NV
_INT, _POINTER = ctypes.c_int, ctypes.c_void_p


def cuda_numbers() -> list[int | None]:
    """CUDA's number of each of EGL's devices, as the driver states it; None: it knows no CUDA.

    Raises:
        GraphicsError: EGL or OpenGL is not installed.
    """
    check_libraries()
    handles, count = (ctypes.c_void_p * MAX_DEVICES)(), ctypes.c_int()
    query = _function("eglQueryDevicesEXT", _INT, _POINTER, _POINTER)
    query(MAX_DEVICES, ctypes.addressof(handles), ctypes.byref(count))
    text = _function("eglQueryDeviceStringEXT", _POINTER, _INT, returns=ctypes.c_char_p)
    attribute = _function("eglQueryDeviceAttribEXT", _POINTER, _INT, _POINTER)
    numbers: list[int | None] = []
    for handle in handles[: count.value]:
        number, extensions = ctypes.c_ssize_t(), text(handle, _EXTENSIONS) or b""
        has_number = b"EGL_NV_device_cuda" in extensions.split() and attribute(
            handle, _CUDA_DEVICE, ctypes.byref(number)
        )
        numbers.append(number.value if has_number else None)
    return numbers


def device_number(device: int | str) -> int:
    """EGL's number of a device; CUDA's are written cuda:1.

    Raises:
        GraphicsError: neither a number nor cuda:N, or EGL has no such device.
    """
    text = str(device)
    kind, _, cuda = text.partition(":")
    number = int(text) if text.isdecimal() else -1
    if kind == "cuda" and cuda.isdecimal() and int(cuda) in (numbers := cuda_numbers()):
        number = numbers.index(int(cuda))
    if not 0 <= number < MAX_DEVICES:
        raise GraphicsError(
            f"device {text}: there is no such device: expected a number as `omnisim info` lists "
            "them, or cuda:N"
        )
    return number


def _function(name: str, *parameters: type, returns: type = ctypes.c_uint) -> Any:
    """Function of EGL by name; one that this EGL lacks returns 0."""
    get: Any = ctypes.CDLL(LIBRARIES[0]).eglGetProcAddress
    get.restype = ctypes.c_void_p
    address = get(name.encode())
    return ctypes.CFUNCTYPE(returns, *parameters)(address) if address else lambda *_: 0
