"""A vehicle made of boxes, what stands around it, and one that is a robot, with their sensors."""

import dataclasses
import re
import tomllib
from pathlib import Path

import numpy as np

from omnisim import LaserScanner, OmniCamera
from omnisim.core.poses import pose
from omnisim.scene import load_scene
from omnisim.scene.model import (
    AlphaMode,
    Instance,
    Light,
    Lighting,
    LightKind,
    Material,
    Mesh,
    Texture,
)
from tests.scenes import room, scene_of

P2AT = Path(__file__).resolve().parents[1] / "scenes" / "p2at"


def p2at_with_every_sensor():
    """Text of its robot file with the sensors that are comments there."""
    text = (P2AT / "robot.toml").read_text(encoding="utf-8")
    return re.sub(r"(?m)^# (?=\[\[sensors\]\]|\w+ = )", "", text)


CAMERA = OmniCamera(
    polygons=None, base_from_rig=pose((-0.1, 0.05, 0.6), roll_deg=2.0, pitch_deg=-3.0, yaw_deg=10.0)
).resized(90)
SCANNER = dataclasses.replace(LaserScanner().without_errors(), range_min_m=0.0)
BASE_FROM_SCANNER = pose((0.2, 0.0, 0.3))
POSES = {
    "at the origin": pose(),
    "turned": pose((0.4, -0.3, -1.2), yaw_deg=130.0),
    "tilted": pose((-0.5, 0.2, -1.0), roll_deg=12.0, pitch_deg=-17.0, yaw_deg=-40.0),
    "upside down": pose((0.0, 0.2, 0.3), roll_deg=180.0),
}


def box(name, material, half_m=0.5, **options):
    """A cube about the origin with four corners a side: with normals or flat, textured."""
    corners, coordinates = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            for u, v in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corner = np.roll((sign, sign * (2 * u - 1), 2 * v - 1), axis)
                corners.append(half_m * corner)
                coordinates.append((u, v))
    quads = 4 * np.arange(6)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        name,
        np.array(corners, dtype=np.float32),
        quads.reshape(-1, 3).astype(np.uint32),
        material,
        texture_coordinates=np.array(coordinates, dtype=np.float32),
        **options,
    )


def scaled(matrix, *factors):
    return matrix @ np.diag([*factors, 1.0])


def checkered(hole_alpha=255):
    pixels = np.full((8, 8, 4), (220, 60, 30, 255), dtype=np.uint8)
    pixels[::2, ::2] = pixels[1::2, 1::2] = (20, 90, 200, hole_alpha)
    return Texture(pixels)


def body():
    """Boxes of every kind of material and transform; one of them mirrored, with normals."""
    smooth = box("smooth", 0)
    normals = smooth.positions / np.linalg.norm(smooth.positions, axis=1, keepdims=True)
    meshes = [
        dataclasses.replace(smooth, normals=normals),
        box("textured", 1),
        box("holed", 2),
        box("glass", 3),
    ]
    materials = [
        Material("paint", (0.8, 0.3, 0.1, 1.0)),
        Material("checks", texture=checkered()),
        Material("mesh", texture=checkered(0), alpha_mode=AlphaMode.MASK, double_sided=True),
        Material("glass", (0.2, 0.9, 0.4, 0.4), alpha_mode=AlphaMode.BLEND),
    ]
    instances = (
        Instance("hull", 0, scaled(pose((0, 0, 0.1)), 0.5, 0.3, 0.1)),
        Instance(
            "tail",
            0,
            scaled(
                pose((-0.4, 0.2, 0.25), roll_deg=20.0, pitch_deg=30.0, yaw_deg=40.0), -0.1, 0.2, 0.3
            ),
        ),
        Instance("box", 1, scaled(pose((0.3, -0.3, 0.2), yaw_deg=15.0), 0.2, 0.2, 0.3)),
        Instance("cage", 2, scaled(pose((0.35, 0.2, 0.3)), 0.1, 0.1, 0.3)),
        Instance("tube", 3, scaled(pose((0.0, -0.15, 0.4)), 0.1, 0.1, 0.2)),
    )
    lamp = Light(LightKind.POINT, (0.0, 1.0, 0.0), 100.0)  # counts for nothing
    scene = scene_of(meshes, materials, lighting=Lighting((0.0, 9.0, 0.0), (lamp,)))
    return dataclasses.replace(scene, name="body", instances=instances, background=(0.0, 1.0, 0.0))


def surroundings():
    """A room with lamps, a textured box and a pane of glass."""
    meshes = [room(), box("crate", 1), box("pane", 2)]
    materials = [
        Material(double_sided=True),
        Material(texture=checkered()),
        Material(base_color=(0.1, 0.2, 0.9, 0.5), alpha_mode=AlphaMode.BLEND, double_sided=True),
    ]
    poses = [np.eye(4), pose((1.5, 0.8, -0.5), roll_deg=10.0, pitch_deg=20.0, yaw_deg=30.0)]
    poses.append(scaled(pose((-1.2, -0.5, 0.0)), 0.02, 1.0, 1.5))
    lamps = (
        Light(LightKind.POINT, (1.0, 0.9, 0.7), 2.0, position_m=np.array([0.5, 0.5, 1.3])),
        Light(LightKind.DIRECTIONAL, (0.3, 0.4, 0.5), 1.0, direction=np.array([0.6, 0.0, -0.8])),
    )
    return scene_of(meshes, materials, poses, Lighting((0.2, 0.2, 0.2), lamps))


def merged(scene, body, world_from_base):
    """One scene in which the body stands at a pose."""
    materials = (*scene.materials, *body.materials)
    meshes = [
        dataclasses.replace(mesh, material=mesh.material + len(scene.materials))
        for mesh in body.meshes
    ]
    instances = [
        Instance(
            instance.name,
            instance.mesh + len(scene.meshes),
            world_from_base @ instance.world_from_mesh,
        )
        for instance in body.instances
    ]
    return dataclasses.replace(
        scene,
        materials=materials,
        meshes=(*scene.meshes, *meshes),
        instances=(*scene.instances, *instances),
    )


def moved(scene, world_from_scene):
    """The scene somewhere else, lamps included."""
    instances = tuple(
        dataclasses.replace(instance, world_from_mesh=world_from_scene @ instance.world_from_mesh)
        for instance in scene.instances
    )
    lights = tuple(
        dataclasses.replace(light, position_m=light.position_m + world_from_scene[:3, 3])
        for light in scene.lighting.lights
    )
    lighting = dataclasses.replace(scene.lighting, lights=lights)
    return dataclasses.replace(scene, instances=instances, lighting=lighting)


def without(scene, *names):
    kept = tuple(instance for instance in scene.instances if instance.name not in names)
    return dataclasses.replace(scene, instances=kept)


def p2at_body():
    return load_scene(P2AT / "p2at.glb")


def mounted_on_p2at(size_px):
    """Its camera, and its scanner's pose."""
    robot = tomllib.loads((P2AT / "robot.toml").read_text(encoding="utf-8"))
    at = {sensor["name"]: pose(sensor["position_m"]) for sensor in robot["sensors"]}
    camera = OmniCamera.from_file(P2AT / "omnicam.toml").resized(size_px)
    return dataclasses.replace(camera, base_from_rig=at["omnicam"]), at["lms200"]
