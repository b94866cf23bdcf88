"""Other people's renderers and libraries, each behind one small function; all are optional."""

from __future__ import annotations

import os
from importlib import import_module

# Before anybody imports pyrender: no display, and none of X11's libraries either.
os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
os.environ.setdefault("PYGLET_HEADLESS", "1")


def is_there(name: str) -> bool:
    """Whether a "module" or "module.attribute" is installed."""
    module, _, attribute = name.partition(".")
    try:
        found = import_module(module)
    except ImportError:
        return False
    return not attribute or hasattr(found, attribute)
