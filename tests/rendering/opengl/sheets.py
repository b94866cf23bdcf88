"""Scenes of bumpy sheets, of every material, in every order."""

import dataclasses

import numpy as np

from omnisim.core.poses import pose as make_pose
from omnisim.scene.model import (
    AlphaMode,
    Instance,
    Light,
    Lighting,
    LightKind,
    Material,
    Mesh,
    Texture,
    Wrap,
)
from tests.scenes import room, scene_of, square
from tests.vehicles import box


def sheet(name, material, side=12, size_m=1.0, bumps_m=0.15, seed=0, up=None):
    """A bumpy sheet, 2 `side`² triangles, its front up, with coordinates of a texture.

    With `up`, its normals are that much up and otherwise at random.
    """
    generator = np.random.default_rng(seed)
    line = np.linspace(-0.5, 0.5, side + 1)
    x, y = np.meshgrid(line, line)
    z = generator.uniform(-bumps_m, bumps_m, x.shape)
    positions = np.stack((size_m * x, size_m * y, z), axis=-1).reshape(-1, 3).astype(np.float32)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    a, b, c, d = first, first + 1, first + side + 2, first + side + 1
    triangles = np.stack((a, b, c, a, c, d), axis=-1).reshape(-1, 3).astype(np.uint32)
    places = (np.stack((x, y), axis=-1).reshape(-1, 2) + 0.5).astype(np.float32)
    normals = None
    if up is not None:
        normals = generator.uniform(-0.5, 0.5, positions.shape) + (0.0, 0.0, up)
        normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    return Mesh(name, positions, triangles, material, normals=normals, texture_coordinates=places)


def _leaves():
    pixels = np.random.default_rng(4).integers(60, 256, (16, 16, 4), dtype=np.uint8)
    pixels[..., 3] = np.where(np.indices((16, 16)).sum(axis=0) % 8 < 4, 255, 0)
    return Texture(pixels, Wrap.REPEAT, Wrap.REPEAT)


MATERIALS = [
    Material("room", double_sided=True),
    Material("red", (0.8, 0.2, 0.1, 1.0)),
    Material("both sides", (0.1, 0.7, 0.2, 1.0), double_sided=True),
    Material("leaves", texture=_leaves(), alpha_mode=AlphaMode.MASK, double_sided=True),
    Material("one side of leaves", texture=_leaves(), alpha_mode=AlphaMode.MASK, alpha_cutoff=0.3),
    Material("glass", (0.3, 0.5, 0.9, 0.4), alpha_mode=AlphaMode.BLEND, double_sided=True),
    Material("unlit", (1.0, 0.9, 0.5, 1.0), unlit=True),
    # one thing in common with another one too few
    Material("red on both sides", (0.8, 0.2, 0.1, 1.0), double_sided=True),
    Material("red unlit", (0.8, 0.2, 0.1, 1.0), unlit=True),
]
CHROME = Material("chrome", (0.9, 0.8, 0.7, 1.0), metallic=1.0, roughness=0.0)
LACQUER = Material(
    "lacquer", (0.2, 0.1, 0.1, 1.0), specular=1.0, roughness=0.8, clearcoat=1.0, double_sided=True
)
POLISH = Material("polish", (0.1, 0.2, 0.3, 1.0), specular=1.0, roughness=0.02, double_sided=True)
PANE = Material(
    "pane", (0.7, 0.9, 0.8, 1.0), specular=1.0, roughness=0.0, transmission=0.9, double_sided=True
)
CLOTH = Material("cloth", (0.5, 0.4, 0.8, 1.0), specular=1.0, roughness=0.6, normal_map=_leaves())
# Without shadows, which have tests of their own.
SUN = Light(
    LightKind.DIRECTIONAL,
    (1.0, 0.9, 0.8),
    0.5,
    direction=np.array([0.6, 0.0, -0.8]),
    casts_shadow=False,
)
LAMP = Light(
    LightKind.POINT, (1.0, 1.0, 1.0), 2.0, position_m=np.array([0.5, -0.5, 1.0]), casts_shadow=False
)


def mixed_scene(*lights):
    """Sheets of every material in a room, at random poses, half of them mirrored or sheared."""
    generator = np.random.default_rng(8)
    meshes, poses = [room()], [np.eye(4)]
    for number in range(48):
        material = 1 + number % (len(MATERIALS) - 1)
        # no normals; normals that point to the front, to whichever side, and to the back; one
        up = (None, 1.0, 0.2, -1.0, 1e9)[number % 5]
        meshes.append(sheet(f"sheet {number}", material, seed=number, up=up))
        at = generator.uniform((-2.6, -1.7, -1.3), (2.6, 1.7, 0.6))
        if np.linalg.norm(at) < 0.9:
            at *= 0.9 / np.linalg.norm(at)
        pose = make_pose(
            at, roll_deg=generator.uniform(0, 360), pitch_deg=generator.uniform(0, 360)
        )
        if number % 4 == 1:
            pose[:3, :3] = pose[:3, :3] @ np.diag((1.0, -0.8, 1.2))
        if number % 4 == 3:
            pose[:3, :3] = pose[:3, :3] @ np.array([[1, 0.3, 0], [0, 1.2, 0], [0, 0, 0.7]])
        poses.append(pose)
    lighting = Lighting((0.2, 0.2, 0.25), lights or (SUN, LAMP))
    return scene_of(meshes, MATERIALS, poses, lighting=lighting, background=(0.1, 0.2, 0.4))


def dynamic_object():
    """A body of opaque, masked and blended sheets beside the camera."""
    meshes = [sheet("deck", 1), sheet("fence", 3), sheet("window", 5)]
    poses = [make_pose((x, 0.6, 0.2), roll_deg=70.0) for x in (-0.6, 0.2, 0.9)]
    return scene_of(meshes, MATERIALS, poses)


def crowd(count=400):
    """Bumpy sheets at random, near and far, behind and before walls; some lie on each other."""
    generator = np.random.default_rng(6)
    meshes = [sheet(f"sheet {n}", 1 + n % 2, side=4, seed=n) for n in range(8)]
    meshes.append(sheet("wall", 0, side=1, size_m=3.0, bumps_m=0.0))
    poses, numbers = [], []
    for number in range(count):
        at = generator.uniform((-12.0, -12.0, -2.0), (12.0, 12.0, 3.0))
        if np.linalg.norm(at) < 1.5:
            continue
        is_wall = number % 4 == 0
        roll_deg = 90.0 if is_wall else generator.uniform(0.0, 360.0)
        pose = make_pose(at, roll_deg=roll_deg, yaw_deg=generator.uniform(0.0, 360.0))
        kinds = (8, 8) if is_wall else (number % 8,)  # walls are there twice, to the last bit
        poses += [pose] * len(kinds)
        numbers += kinds
    meshes = [dataclasses.replace(meshes[n], name=str(at)) for at, n in enumerate(numbers)]
    lighting = Lighting((0.2, 0.2, 0.25), (SUN,))
    return scene_of(meshes, MATERIALS, poses, lighting=lighting, background=(0.1, 0.2, 0.4))


def with_mirrors(scene, panes=True):
    """Fewer of its sheets, a mirror's box, a coated table, a wall, two panes and a bumpy cloth."""
    scene = dataclasses.replace(scene, instances=(scene.instances[0], *scene.instances[3::4]))
    first, materials = len(scene.materials), (CHROME, LACQUER, POLISH, PANE, CLOTH)
    meshes = [
        box("block", first, 0.5),
        square(1.5, material=first + 1, name="table"),
        square(1.2, material=first + 2, name="wall"),
        square(0.6, material=first + 3, name="window"),
        square(0.4, material=first + 3, name="lid"),
        sheet("cloth", first + 4, up=1.0),
    ]
    places = [
        make_pose((1.2, 0.6, 0.0), yaw_deg=30.0, roll_deg=15.0),
        make_pose((0.5, 0.0, -1.0)),
        # flips the winding
        make_pose((2.7, -0.4, 0.3), pitch_deg=80.0) @ np.diag((1.0, -1.0, 1.0, 1.0)),
        make_pose((0.0, 0.1, 0.2), pitch_deg=85.0, yaw_deg=10.0),
        make_pose((0.0, 0.9, -0.4), roll_deg=20.0),
        make_pose((1.2, -0.6, -0.3), pitch_deg=-60.0),
    ]
    count = len(scene.meshes)
    instances = [
        Instance(mesh.name, count + number, place)
        for number, (mesh, place) in enumerate(zip(meshes, places, strict=True))
    ]
    if not panes:
        instances = [instance for instance in instances if instance.name not in ("window", "lid")]
    return dataclasses.replace(
        scene,
        meshes=(*scene.meshes, *meshes),
        materials=(*scene.materials, *materials),
        instances=(*scene.instances, *instances),
    )
