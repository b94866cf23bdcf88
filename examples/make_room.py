"""A furnished room with a lamp, made with trimesh and NumPy: `python examples/make_room.py`."""

import sys
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

Rgb, Size = tuple[int, int, int], tuple[float, float, float]
SIZE_M = (6.0, 5.0, 2.6)
LAMP_M = (0.0, 0.0, 2.1)
MAX_FLAT_FACES = 100  # of meshes with edges
Y_UP = trimesh.transformations.rotation_matrix(-np.pi / 2.0, [1.0, 0.0, 0.0])
random = np.random.default_rng(1)


def grain(height: int, width: int, stretch: int, level: float) -> NDArray[np.float64]:
    """Random brightness (height, width, 1) about 1, drawn out along the rows."""
    fine = random.normal(1.0, level, (height, width // stretch))
    return np.repeat(fine, stretch, axis=1)[:, :width, None]


def planks(color: Rgb, rows: int = 8) -> NDArray[np.float64]:
    """Texture (512, 512, 3) of boards, of which each row is shifted."""
    high = 512 // rows
    texture = np.array(color) * grain(512, 512, 16, 0.05)
    for row in range(0, 512, high):
        texture[row : row + high] *= random.uniform(0.8, 1.1)
        texture[row : row + 2] *= 0.55
        texture[row : row + high, random.integers(510) :][:, :2] *= 0.55
    return texture


def plaster(color: Rgb) -> NDArray[np.float64]:
    """Texture (256, 256, 3) of a rough wall."""
    return np.array(color) * np.repeat(np.repeat(grain(128, 128, 1, 0.025), 2, 0), 2, 1)


def tiles(first: Rgb, second: Rgb, count: int, border: int = 0) -> NDArray[np.float64]:
    """Texture (512, 512, 3) of a checkerboard, with a border in the second color."""
    rows, columns = np.indices((512, 512)) * count // 512
    texture = np.where(((rows + columns) % 2 == 0)[..., None], first, second) * 1.0
    inner = np.zeros((512, 512, 1), dtype=bool)
    inner[border : 512 - border, border : 512 - border] = True
    return np.where(inner, texture, second) * grain(512, 512, 2, 0.04)


def landscape() -> NDArray[np.float64]:
    """Texture (256, 384, 3): hills below a sky."""
    height, x = np.linspace(0.0, 1.0, 256)[:, None], np.linspace(0.0, 9.0, 384)[None]
    texture = np.stack(np.broadcast_arrays(95 + 120 * height, 150 + 70 * height, 225 + x * 0), -1)
    for level, wave, color in ((0.5, 1.3, (120, 140, 160)), (0.65, 0.9, (85, 130, 75)),
                               (0.8, 1.7, (55, 95, 45))):  # fmt: skip
        texture[height > level + 0.07 * np.sin(wave * x + 7 * level)] = color
    return texture


def painted(
    mesh: trimesh.Trimesh,
    texture: NDArray[np.float64] | Rgb,
    tile_m: float | tuple[float, float] = 1.0,
    roughness: float = 0.9,
) -> trimesh.Trimesh:
    """Mesh with a texture that repeats along its sides, or a color; sRGB from 0 to 255."""
    points = mesh.triangles.reshape(-1, 3)
    normals = np.repeat(trimesh.triangles.normals(mesh.triangles)[0], 3, axis=0)
    axis = np.abs(normals).argmax(axis=1)
    across = np.where(axis == 0, points[:, 1], points[:, 0])
    along = np.where(axis == 2, points[:, 1], points[:, 2])
    pixels = np.clip(np.array(texture, ndmin=3), 0, 255).astype(np.uint8)
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(pixels), metallicFactor=0.0, roughnessFactor=roughness
    )
    is_round = len(mesh.faces) > MAX_FLAT_FACES
    return trimesh.Trimesh(
        points,
        np.arange(len(points)).reshape(-1, 3),
        vertex_normals=mesh.vertex_normals[mesh.faces.ravel()] if is_round else normals,
        visual=trimesh.visual.TextureVisuals(
            np.stack((across, along), axis=1) / tile_m + 0.5, material=material
        ),
        process=False,
    )


def box(size_m: Size, *paint: Any, **options: Any) -> trimesh.Trimesh:
    """Box with a texture, or a color."""
    return painted(trimesh.creation.box(size_m), *paint, **options)


def with_lamp(tree: dict[str, Any]) -> None:
    """Add the lamp to the JSON of a glTF file, which trimesh has no lamps for."""
    lamp = {"type": "point", "color": [1.0, 0.93, 0.82], "intensity": 150.0}
    name = "KHR_lights_punctual"
    tree.setdefault("extensionsUsed", []).append(name)
    tree["extensions"] = {name: {"lights": [lamp]}}
    tree["scenes"][0]["nodes"].append(len(tree["nodes"]))
    position = (Y_UP @ (*LAMP_M, 1.0))[:3].tolist()
    tree["nodes"].append(
        {"name": "lamp", "translation": position, "extensions": {name: {"light": 0}}}
    )


def main(path: str) -> None:
    """Write the scene; z is up here, and glTF's y is: the root turns it."""
    scene = trimesh.Scene()
    wood, dark = planks((176, 126, 78), 4), planks((105, 70, 44), 4)

    def add(name: str, mesh: trimesh.Trimesh, x: float, y: float, z: float) -> None:
        place = trimesh.transformations.translation_matrix([x, y, z])
        scene.add_geometry(mesh, node_name=name, transform=Y_UP @ place)

    length, width, height = SIZE_M
    walls = trimesh.creation.box(SIZE_M)
    walls.invert()
    up = walls.triangles_center[:, 2]
    for name, faces, paint, tile_m in (
        ("walls", np.abs(up) < 1.0, plaster((214, 205, 186)), 1.5),
        ("floor", up < -1.0, planks((166, 120, 80)), 1.2),
        ("ceiling", up > 1.0, plaster((236, 234, 228)), 1.5),
    ):
        add(name, painted(walls.submesh([faces], append=True), paint, tile_m), 0, 0, height / 2)
    for side, size, y, x in (
        ("a", (length, 0.02, 0.1), width / 2 - 0.01, 0.0),
        ("b", (length, 0.02, 0.1), 0.01 - width / 2, 0.0),
        ("c", (0.02, width, 0.1), 0.0, length / 2 - 0.01),
        ("d", (0.02, width, 0.1), 0.0, 0.01 - length / 2),
    ):
        add(f"skirting {side}", box(size, (240, 238, 232)), x, y, 0.05)
    rug = tiles((150, 40, 45), (225, 205, 165), 8, 40)
    add("rug", box((2.0, 1.6, 0.004), rug, (2.0, 1.6)), 0.2, -0.1, 0.002)
    add("crate", box((0.6, 0.6, 0.6), wood, 0.6), 1.4, 0.8, 0.3)
    beach = tiles((205, 30, 35), (245, 240, 230), 4)
    ball = trimesh.creation.icosphere(4, 0.25)
    add("ball", painted(ball, beach, 0.5, roughness=0.4), 1.2, -0.9, 0.25)
    pillar = trimesh.creation.cylinder(0.15, height, sections=48)
    add("pillar", painted(pillar, tiles((52, 92, 150), (60, 104, 166), 8), 1.3), -1.5, 1.2, 1.3)

    add("table top", box((1.4, 0.7, 0.04), dark, 0.7), -1.2, -2.05, 0.74)
    legs = [(x, y) for x in (-1.84, -0.56) for y in (-2.34, -1.76)]
    for number, (x, y) in enumerate(legs):
        add(f"table leg {number}", box((0.06, 0.06, 0.72), dark, 0.7), x, y, 0.36)
    lampshade = trimesh.creation.cone(0.18, 0.3, sections=48)
    add("vase", painted(lampshade, (46, 130, 122), roughness=0.3), -1.5, -2.1, 0.76)

    colors = ((168, 48, 44), (45, 84, 130), (206, 160, 62), (70, 112, 74), (92, 64, 104))
    add("shelf back", box((1.6, 0.02, 1.9), wood, 0.8), 0.6, 2.48, 0.95)
    for level in range(5):
        add(f"shelf {level}", box((1.6, 0.3, 0.03), wood, 0.8), 0.6, 2.33, 0.02 + 0.46 * level)
    for number in range(40):
        level, place = divmod(number, 10)
        tall = random.uniform(0.22, 0.34)
        x = -0.1 + 0.12 * place + random.uniform(0.0, 0.04)
        book = box((random.uniform(0.03, 0.09), 0.2, tall), colors[random.integers(5)])
        add(f"book {number}", book, x, 2.36, 0.035 + 0.46 * level + tall / 2)

    for name, size, x, y, z, paint in (
        ("picture frame", (0.03, 1.3, 0.9), 2.985, -0.6, 1.5, (60, 44, 32)),
        ("door frame", (0.03, 1.06, 2.1), -2.985, 0.0, 1.05, (240, 238, 232)),
        ("door", (0.05, 0.9, 2.0), -2.98, 0.0, 1.0, dark),
    ):
        add(name, box(size, paint, 0.9), x, y, z)
    add("picture", box((0.04, 1.2, 0.8), landscape(), (1.2, 0.8)), 2.985, -0.6, 1.5)
    add("door handle", box((0.08, 0.12, 0.03), (190, 185, 170), roughness=0.3), -2.94, 0.33, 1.0)
    bulb = painted(trimesh.creation.icosphere(3, 0.045), (255, 255, 255))
    bulb.visual.material.emissiveFactor = [1.0, 1.0, 1.0]
    add("bulb", bulb, *LAMP_M)
    cord = height - LAMP_M[2]
    add("cord", box((0.012, 0.012, cord), (30, 30, 30)), *LAMP_M[:2], height - cord / 2)
    scene.export(path, tree_postprocessor=with_lamp)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "room.glb")
