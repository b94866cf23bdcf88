"""Independent renderers and libraries, each behind a small function; all are optional."""

from __future__ import annotations

import os
from importlib import import_module

from omnisim.core.extras import install_hint

# Before pyrender is imported: no display, and no X11 libraries.
os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
os.environ.setdefault("PYGLET_HEADLESS", "1")


# System libraries that pip does not install.
SYSTEM_LIBRARIES = {"mitsuba": "libatomic1"}


def import_failure(name: str) -> str:
    """Reason why a "module" or "module.attribute" is unusable, with a remedy; empty: usable."""
    module, _, attribute = name.partition(".")
    try:
        imported = import_module(module)
    except ModuleNotFoundError:
        hint = " (on Python 3.11 only)" if name == "pyrender" else ""
        return f"{name} is not installed: {install_hint('oracles')}{hint}"
    except Exception as broken:  # any error of a broken installation
        message = " ".join(f"{type(broken).__name__}: {broken}".split())
        library = SYSTEM_LIBRARIES.get(module)
        hint = f"; sudo apt-get install {library} may help" if library else ""
        return f"{name} is installed and cannot be imported{hint}: {message[:200]}"
    if attribute and not hasattr(imported, attribute):
        return f"{name} is not in this {module}: {install_hint('oracles')}"
    return ""
