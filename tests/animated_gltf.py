"""Animated glTF files from plain numbers."""

import numpy as np

from tests.scene.gltf_builder import GltfBuilder

WORLD_FROM_FILE = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


class Animated(GltfBuilder):
    """A file with animations, and parents and children."""

    def __init__(self):
        super().__init__()
        self.tree["animations"] = []

    def animate(self, name, *channels):
        """Channels: node, path, times, values, interpolation."""
        animation = {"name": name, "channels": [], "samplers": []}
        for node, path, times_s, values, interpolation in channels:
            sampler = {
                "input": self.accessor(np.asarray(times_s, "<f4"), "SCALAR"),
                "output": self.accessor(np.asarray(values, "<f4"), f"VEC{np.shape(values)[1]}"),
                "interpolation": interpolation,
            }
            target = {"node": node, "path": path}
            animation["channels"].append({"sampler": len(animation["samplers"]), "target": target})
            animation["samplers"].append(sampler)
        self.tree["animations"].append(animation)

    def child(self, parent, **node):
        self.node(**node)
        index = self.tree["scenes"][0]["nodes"].pop()
        self.tree["nodes"][parent].setdefault("children", []).append(index)
        return index
