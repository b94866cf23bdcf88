"""Random rooms with bodies, some of which move, and the rays' own answer to what is in them."""

import dataclasses
from functools import cache

import numpy as np
import pytest
import trimesh

from omnisim.core.poses import pose
from omnisim.scene.model import Instance, Material, Mesh
from tests.scenes import ROOM_HALF_M, room, scene_of

SHAPES = {
    "box": lambda: trimesh.creation.box((1.0, 1.0, 1.0)),
    "ball": lambda: trimesh.creation.icosphere(subdivisions=2, radius=0.5),
    "cone": lambda: trimesh.creation.cone(radius=0.5, height=1.0, sections=24),
    "ring": lambda: trimesh.creation.torus(0.45, 0.12, major_sections=24, minor_sections=10),
    "washer": lambda: trimesh.creation.annulus(0.25, 0.5, 0.05, sections=24),
}
MATERIALS = [Material(double_sided=True), Material()]
BOX = 0.6  # half a side of a box around each shape
FREE_M = 0.25  # no surface is nearer to a viewpoint: the virtual cameras have a near plane


@cache
def _meshes():
    """The room, and each shape with each material."""
    shapes = [(name, make()) for name, make in SHAPES.items()]
    return [room()] + [
        Mesh(name, shape.vertices.astype(np.float32), shape.faces.astype(np.uint32), material)
        for name, shape in shapes
        for material in range(len(MATERIALS))
    ]


def angles(random, most_deg=180.0):
    """Roll, pitch and yaw in degrees, by name."""
    roll_deg, pitch_deg, yaw_deg = random.uniform(-most_deg, most_deg, 3) * (1.0, 0.5, 1.0)
    return {"roll_deg": roll_deg, "pitch_deg": pitch_deg, "yaw_deg": yaw_deg}


@dataclasses.dataclass
class World:
    """A room with bodies; moving objects have a pose at each time."""

    scene: object  # static room and bodies
    objects: dict  # scene of each moving object by name
    starts: dict  # pose (4, 4) of each of them, its velocity in m/s (3,), and its yaw rate
    velocities: dict
    turns_degps: dict
    viewpoint: np.ndarray  # pose (4, 4) of the sensor at time 0, its velocity (3,) and yaw rate
    speed_mps: np.ndarray
    turn_degps: float

    def object_poses(self, time_s):
        """Poses of the moving objects by name."""
        return {
            name: pose(self.velocities[name] * time_s)
            @ start
            @ pose(yaw_deg=self.turns_degps[name] * time_s)
            for name, start in self.starts.items()
        }

    def sensor_pose(self, time_s):
        """Pose of the sensor."""
        return self.viewpoint @ pose(self.speed_mps * time_s, yaw_deg=self.turn_degps * time_s)

    def own_rays(self, time_s):
        """Own rays at all surfaces where they are at a time."""
        parts = placed(self.scene, np.eye(4))
        for name, where in self.object_poses(time_s).items():
            parts += placed(self.objects[name], where)
        return OwnRays(parts)


def placed(scene, world_from_object):
    """Name and corners (m, 3, 3) of each instance, world."""
    parts = []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        points = mesh.positions.astype(np.float64)
        matrix = world_from_object @ instance.world_from_mesh
        parts.append((instance.name, (points @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangles]))
    return parts


@dataclasses.dataclass
class Met:
    """Surfaces that rays meet: range, +inf for none; number of the instance, −1 for none; normal
    of the plane toward the ray's origin."""

    ranges_m: np.ndarray
    owners: np.ndarray
    normals: np.ndarray


class OwnRays:
    """Embree finds the triangles that rays meet, in float32; where they meet follows in float64."""

    def __init__(self, parts):
        pytest.importorskip("embreex", reason="embreex, which casts own rays, is missing")
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.names = [name for name, _ in parts]
        self._corners_m = np.concatenate([corners for _, corners in parts])
        self._owners = np.repeat(np.arange(len(parts)), [len(corners) for _, corners in parts])
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, self._corners_m.astype(np.float32))

    def meet(self, origins_m, directions):
        """First hits of rays (n, 3) with unit directions (n, 3)."""
        origins_m = np.broadcast_to(origins_m, directions.shape)
        found = self._scene.run(
            np.ascontiguousarray(origins_m, np.float32),
            np.ascontiguousarray(directions, np.float32),
        )
        hit = np.flatnonzero(found >= 0)
        met = Met(
            np.full(len(directions), np.inf),
            np.full(len(directions), -1),
            np.zeros(directions.shape),
        )
        a, b, c = np.moveaxis(self._corners_m[found[hit]], 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        along = np.einsum("ij,ij->i", normals, directions[hit])
        to_plane_m = np.einsum("ij,ij->i", normals, a - origins_m[hit])
        met.ranges_m[hit] = to_plane_m / np.where(along == 0.0, 1e-300, along)
        met.owners[hit] = self._owners[found[hit]]
        met.normals[hit] = -np.sign(along)[:, None] * normals
        return met


def world_by_chance(random, fastest_mps=1.0, fewest_moving=0):
    """A room of any size and pose with 2 to 25 bodies, up to two of which move."""
    meshes = _meshes()
    while True:
        world_from_room = pose(random.uniform(-5.0, 5.0, 3), **angles(random))
        half_m = ROOM_HALF_M * random.uniform(1.0, 3.0, 3)
        bodies = [
            (1 + int(random.integers(len(meshes) - 1)), _body_pose(random, world_from_room, half_m))
            for _ in range(random.integers(2, 26))
        ]
        moving = int(random.integers(fewest_moving, 3))
        placed = [(0, world_from_room @ np.diag([*(half_m / ROOM_HALF_M), 1.0])), *bodies[moving:]]
        scene = _scene("static", placed)
        names = [f"moving {number}" for number in range(moving)]
        objects, starts, velocities, turns = {}, {}, {}, {}
        for name, (mesh, matrix) in zip(names, bodies[:moving], strict=True):
            own = matrix.copy()
            own[:3, 3] = 0.0
            objects[name], starts[name] = _scene(name, [(mesh, own)]), pose(matrix[:3, 3])
            velocity = random.normal(size=3)
            speed_mps = random.uniform(0.0, fastest_mps)
            velocities[name] = speed_mps * velocity / np.linalg.norm(velocity)
            turns[name] = random.uniform(-45.0, 45.0)
        offset = random.uniform(-0.8, 0.8, 3) * half_m
        viewpoint = world_from_room @ pose(offset, **angles(random))
        speed_mps = random.normal(size=3) * 0.5 * random.integers(2)
        world = World(
            scene, objects, starts, velocities, turns, viewpoint, speed_mps, random.uniform(-10, 10)
        )
        if all(_is_free(world, time_s) for time_s in (0.0, 0.05, 0.1)):
            return world


def _body_pose(random, world_from_room, half_m):
    """Matrix (4, 4) of a body: any pose, any scale, often mirrored."""
    scale = random.uniform(0.3, 1.5, 3) * random.choice([-1.0, 1.0], 3, p=[0.3, 0.7])
    offset = random.uniform(-1.0, 1.0, 3) * half_m
    return world_from_room @ pose(offset, **angles(random)) @ np.diag([*scale, 1.0])


def _scene(name, placed):
    meshes = _meshes()
    scene = scene_of(meshes, MATERIALS, poses=[np.eye(4)] * len(meshes))
    instances = tuple(
        Instance(f"{name} {number}", mesh, matrix) for number, (mesh, matrix) in enumerate(placed)
    )
    return dataclasses.replace(scene, instances=instances)


def _is_free(world, time_s):
    """True if the sensor is in the room, and no body's box is near it."""
    origin_m = world.sensor_pose(time_s)[:3, 3]
    bodies = [instance.world_from_mesh for instance in world.scene.instances]
    for name, where in world.object_poses(time_s).items():
        bodies.append(where @ world.objects[name].instances[0].world_from_mesh)
    for number, matrix in enumerate(bodies):
        local = np.abs(np.linalg.inv(matrix)[:3] @ [*origin_m, 1.0])
        sizes = np.linalg.norm(matrix[:3, :3], axis=0)
        if number == 0:
            if np.min((ROOM_HALF_M - local) * sizes) < FREE_M:
                return False
        elif np.linalg.norm(np.maximum(local - BOX, 0.0) * sizes) < FREE_M:
            return False
    return True
