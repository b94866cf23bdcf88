"""A puddle, made with trimesh: `python examples/make_puddle.py puddle.glb 0.6`.

It is a film of water: a pane that lets the floor shine through, and reflects.
"""

import sys

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

EXTENSIONS = {
    "KHR_materials_transmission": {"transmissionFactor": 1.0},
    "KHR_materials_ior": {"ior": 1.33},
}
CORNERS, HEIGHT_M = 48, 0.002


def main(path: str, radius_m: float) -> None:
    """Write the puddle, its middle at the origin, y up as in glTF."""
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    radius = radius_m * (1.0 + 0.18 * np.sin(2.0 * angle) + 0.10 * np.cos(5.0 * angle))
    rim = np.stack((radius * np.cos(angle), 0.0 * angle, -radius * np.sin(angle)), axis=1)
    vertices = np.concatenate(([[0.0, 0.0, 0.0]], rim)) + (0.0, HEIGHT_M, 0.0)
    numbers = np.arange(CORNERS)
    faces = np.stack((0 * numbers, 1 + numbers, 1 + (numbers + 1) % CORNERS), axis=1)
    water = PBRMaterial(
        name="water", baseColorFactor=(210, 215, 215, 255), metallicFactor=0.0, roughnessFactor=0.0
    )
    mesh = trimesh.Trimesh(vertices, faces, visual=TextureVisuals(material=water), process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name="puddle")
    scene.export(path, tree_postprocessor=_as_water)


def _as_water(tree: dict) -> None:
    for material in tree["materials"]:
        material["extensions"] = EXTENSIONS
    tree["extensionsUsed"] = sorted(EXTENSIONS)


if __name__ == "__main__":
    main(
        sys.argv[1] if len(sys.argv) > 1 else "puddle.glb",
        float(sys.argv[2]) if len(sys.argv) > 2 else 0.6,
    )
