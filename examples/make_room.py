"""A room with a crate, a ball and a pillar, made with trimesh: `python examples/make_room.py`."""

import sys

import numpy as np
import trimesh


def painted(mesh: trimesh.Trimesh, color: tuple[float, float, float]) -> trimesh.Trimesh:
    """Give a mesh one base colour, linear RGB."""
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[*color, 1.0], metallicFactor=0.0, roughnessFactor=1.0
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh


def main(path: str) -> None:
    """Write the scene; z is up here, and glTF's y is: the root turns it."""
    scene = trimesh.Scene()
    y_up = trimesh.transformations.rotation_matrix(-np.pi / 2.0, [1.0, 0.0, 0.0])

    def add(name: str, mesh: trimesh.Trimesh, x: float, y: float, z: float) -> None:
        place = trimesh.transformations.translation_matrix([x, y, z])
        scene.add_geometry(mesh, node_name=name, transform=y_up @ place)

    walls = trimesh.creation.box((6.0, 5.0, 2.6))
    walls.invert()
    add("walls", painted(walls, (0.75, 0.72, 0.65)), 0.0, 0.0, 1.3)
    add("crate", painted(trimesh.creation.box((0.6, 0.6, 0.6)), (0.6, 0.3, 0.1)), 1.4, 0.8, 0.3)
    add("ball", painted(trimesh.creation.icosphere(3, 0.25), (0.8, 0.05, 0.05)), 1.2, -0.9, 0.25)
    pillar = trimesh.creation.cylinder(0.15, 2.6, sections=48)
    add("pillar", painted(pillar, (0.1, 0.3, 0.7)), -1.5, 1.2, 1.3)
    scene.export(path)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "room.glb")
