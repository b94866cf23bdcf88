"""Required and optional packages of omnisim, and errors about missing extras."""

from __future__ import annotations

import platform
import sys
from importlib.util import find_spec

from omnisim.core.errors import GraphicsError, OmnisimError

DISTRIBUTION = "omnisim-camera"  # the index has another package called omnisim

# Module of each package, by the package's name on the index, as in pyproject.toml.
REQUIRED = {
    "click": "click",
    "mapbox-earcut": "mapbox_earcut",
    "numpy": "numpy",
    "OpenImageIO": "OpenImageIO",
    "pillow": "PIL",
    "pycollada": "collada",
    "pydantic": "pydantic",
    "PyYAML": "yaml",
    "rich": "rich",
    "scipy": "scipy",
    "trimesh": "trimesh",
    "websockets": "websockets",
}
EXTRAS = {
    "opengl": {"moderngl": "moderngl"},  # also required, where a wheel exists
    "plots": {"matplotlib": "matplotlib"},
    "reports": {"matplotlib": "matplotlib", "jinja2": "jinja2"},
    "rays": {"embreex": "embreex"},
    "bake": {"embreex": "embreex", "xatlas": "xatlas"},
    "video": {"av": "av"},
    "measure": {"opencv-contrib-python-headless": "cv2"},
    "raw": {"rawpy": "rawpy"},
    "serve": {"foxglove-sdk": "foxglove", "rosbags": "rosbags"},
    "zenoh": {"eclipse-zenoh": "zenoh", "rosbags": "rosbags", "xxhash": "xxhash"},
    "estimators": {"kiss-icp": "kiss_icp", "pycolmap": "pycolmap", "small-gicp": "small_gicp"},
    "orb-slam3": {"pyorbslam3": "pyorbslam3"},  # GPL: on demand only
    "mujoco": {"mujoco-core": "mujoco"},
    "newton": {"newton": "newton"},
    "genesis": {"genesis-world": "genesis"},
    "gymnasium": {"gymnasium": "gymnasium"},
    "pybullet": {"pybullet": "pybullet"},
    "sapien": {"sapien": "sapien"},
    "usd": {"usd-core": "pxr"},
    "ray": {"ray": "ray"},
    "ros": {"rosbags": "rosbags"},
    "draco": {"DracoPy": "DracoPy"},
    "meshopt": {"meshoptimizer": "meshoptimizer"},  # compiled during installation
    "oracles": {
        "embreex": "embreex",
        "emva1288": "emva1288",
        "evo": "evo",
        "mcap-ros2-support": "mcap_ros2",
        "mitsuba": "mitsuba",
        "opencv-contrib-python-headless": "cv2",
        "pycolmap": "pycolmap",
        "xatlas": "xatlas",
        **({"pyrender": "pyrender"} if sys.version_info < (3, 12) else {}),
    },
}


def is_installed(module: str) -> bool:
    """True if a module can be found; it is not imported."""
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # the parent package is missing, too
        return False


def missing_packages(extra: str) -> list[str]:
    """Packages of an extra that are not installed."""
    return [package for package, module in EXTRAS[extra].items() if not is_installed(module)]


def install_hint(extra: str) -> str:
    """Command that installs an extra beside omnisim, also for an omnisim from a checkout."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"


def require_extra(extra: str, feature: str, error: type[OmnisimError] = OmnisimError) -> None:
    """Reject a feature whose packages are missing, before any work is done.

    `extra` is a key of `EXTRAS`; the feature, a command, an option or a file, is the message's
    subject.

    Raises:
        OmnisimError: packages are missing; names them and the command that installs them.
    """
    missing = missing_packages(extra)
    if missing:
        raise error(f"{feature} needs {' and '.join(missing)}: {install_hint(extra)}")


def require_opengl(feature: str) -> None:
    """Reject a feature where OpenGL is unavailable, before anything imports moderngl.

    Raises:
        GraphicsError: the system is not Linux, or moderngl is missing.
    """
    if platform.system() != "Linux":
        need = "OpenGL through EGL, which Linux alone has"
    elif not is_installed("moderngl"):
        need = f"moderngl: {install_hint('opengl')}"
    else:
        return
    raise GraphicsError(f"{feature} needs {need}; back end 'rays' needs no OpenGL")
