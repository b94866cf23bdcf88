"""What there is to see: plain data, and its loading (the only importer of trimesh)."""

import logging

from omnisim.scene.load import load_scene
from omnisim.scene.model import Scene
from omnisim.scene.source import builtin_scenes

__all__ = ["Scene", "builtin_scenes", "load_scene"]

# What trimesh would write to standard error is said in our own words, as errors and notices.
logging.getLogger("trimesh").addHandler(logging.NullHandler())
