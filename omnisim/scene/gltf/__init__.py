"""glTF 2.0, read directly: one module for each part of the specification."""

from omnisim.scene.gltf.reader import read_gltf

__all__ = ["read_gltf"]
