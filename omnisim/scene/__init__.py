"""Scenes: plain data, and the readers of scene files (the only importer of trimesh).

Readers raise a one-line SceneError for any fault in a file.
"""

from omnisim.scene.files.load import builtin_scenes, load_scene, read_scene
from omnisim.scene.model import Scene

__all__ = ["Scene", "builtin_scenes", "load_scene", "read_scene"]
