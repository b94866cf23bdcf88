"""What there is to see: plain data, and its loading (the only importer of trimesh, which reads
every format but glTF)."""

from omnisim.scene.builtin import builtin_scenes
from omnisim.scene.load import load_scene
from omnisim.scene.model import Scene

__all__ = ["Scene", "builtin_scenes", "load_scene"]
