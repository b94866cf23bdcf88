"""A walking figure of 13 joints as a glTF file, and its vertices by NumPy and SciPy alone."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tests.animated_gltf import WORLD_FROM_FILE, Animated

# Name, parent, place of the joint in the file's frame (y up), end of its tube, radius.
JOINTS = [
    ("hips", None, (0, 0.9, 0), (0, 1.15, 0), 0.15),
    ("spine", 0, (0, 1.15, 0), (0, 1.45, 0), 0.16),
    ("head", 1, (0, 1.5, 0), (0, 1.75, 0), 0.1),
    ("arm.L", 1, (0.22, 1.42, 0), (0.24, 1.15, 0), 0.055),
    ("forearm.L", 3, (0.24, 1.15, 0), (0.25, 0.85, 0), 0.045),
    ("arm.R", 1, (-0.22, 1.42, 0), (-0.24, 1.15, 0), 0.055),
    ("forearm.R", 5, (-0.24, 1.15, 0), (-0.25, 0.85, 0), 0.045),
    ("thigh.L", 0, (0.1, 0.88, 0), (0.1, 0.47, 0), 0.08),
    ("shin.L", 7, (0.1, 0.47, 0), (0.1, 0.08, 0), 0.06),
    ("foot.L", 8, (0.1, 0.08, 0), (0.1, 0.03, 0.2), 0.045),
    ("thigh.R", 0, (-0.1, 0.88, 0), (-0.1, 0.47, 0), 0.08),
    ("shin.R", 10, (-0.1, 0.47, 0), (-0.1, 0.08, 0), 0.06),
    ("foot.R", 11, (-0.1, 0.08, 0), (-0.1, 0.03, 0.2), 0.045),
]
PERIOD_S, KEYS, RINGS, SIDES = 1.0, 9, 7, 10
TIMES_S = np.linspace(0.0, PERIOD_S, KEYS)
# Swing about x in degrees, and its phase in turns.
SWINGS = {
    1: (4, 0.1), 2: (6, 0.3), 3: (30, 0.5), 4: (25, 0.4), 5: (30, 0.0), 6: (25, 0.9),
    7: (32, 0.0), 8: (30, 0.25), 9: (20, 0.1), 10: (32, 0.5), 11: (30, 0.75), 12: (20, 0.6),
}  # fmt: skip
WALK = np.stack([0.02 * np.sin(4 * np.pi * TIMES_S), TIMES_S * 0, 0.9 * TIMES_S], axis=1)
BIND = np.array([place for _, _, place, _, _ in JOINTS], dtype=float)
PARENTS = [parent for _, parent, *_ in JOINTS]
FIGURE = [1.3, 0.0, 0.4]  # of the node above the hips, in the file's frame


def _tube(start, end, radius):
    """Vertices, normals, share of the way along, and triangles of a closed tube."""
    start, end = np.array(start, float), np.array(end, float)
    axis = (end - start) / np.linalg.norm(end - start)
    side = np.cross(axis, [0.3, 0.1, 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(axis, side)
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    around = np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * up
    share = np.linspace(-0.05, 1.05, RINGS)
    points = start + share[:, None, None] * (end - start) + radius * around
    ring = np.arange(SIDES)
    triangles = []
    for first in range(0, SIDES * (RINGS - 1), SIDES):
        a, b = first + ring, first + np.roll(ring, -1)
        triangles += [np.stack((a, b, a + SIDES), 1), np.stack((b, b + SIDES, a + SIDES), 1)]
    count = RINGS * SIDES
    caps = [
        [SIDES * r, SIDES * r + k, SIDES * r + k + 1]
        for r in (0, RINGS - 1)
        for k in range(1, SIDES - 1)
    ]
    return (
        points.reshape(-1, 3), np.tile(around, (RINGS, 1, 1)).reshape(-1, 3),
        np.repeat(share, SIDES), np.concatenate((*triangles, np.array(caps))), count,
    )  # fmt: skip


class Figure:
    """Arrays of the figure as bound: positions, normals, triangles, joints, weights."""

    def __init__(self):
        parts, base = [], 0
        for number, (_, parent, start, end, radius) in enumerate(JOINTS):
            points, normals, share, triangles, count = _tube(start, end, radius)
            joints = np.zeros((count, 4), int)
            joints[:, 0], joints[:, 1] = number, number if parent is None else parent
            weights = np.zeros((count, 4))
            weights[:, 1] = 0.0 if parent is None else 0.5 * np.clip(1 - 4 * share, 0, 1)
            weights[:, 0] = 1 - weights[:, 1]
            parts.append((points, normals, triangles + base, joints, weights))
            base += count
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        self.positions, self.normals, self.triangles, self.joints, self.weights = columns
        self.positions = self.positions.astype("<f4").astype(float)
        self.turns = {
            joint: Rotation.from_euler(
                "xy", np.stack((np.sin(2 * np.pi * (TIMES_S + phase)), 0.2 * np.cos(TIMES_S)), 1)
                * degrees, degrees=True,
            )
            for joint, (degrees, phase) in SWINGS.items()
        }  # fmt: skip

    def nodes_at(self, time_s):
        """Global transforms (joints, 4, 4) in the file's frame."""
        time_s = time_s % PERIOD_S
        above = np.eye(4)
        above[:3, 3] = FIGURE
        found = []
        for number, parent in enumerate(PARENTS):
            local = np.eye(4)
            local[:3, 3] = BIND[number] - (0 if parent is None else BIND[parent])
            if parent is None:
                local[:3, 3] += [np.interp(time_s, TIMES_S, WALK[:, k]) for k in range(3)]
            if number in self.turns:
                local[:3, :3] = Slerp(TIMES_S, self.turns[number])(time_s).as_matrix()
            found.append((above if parent is None else found[parent]) @ local)
        return np.stack(found)

    def blended(self, time_s):
        """Transforms (n, 4, 4) of the vertices into the world."""
        binds = np.tile(np.eye(4), (len(JOINTS), 1, 1))
        binds[:, :3, 3] = -BIND
        matrices = WORLD_FROM_FILE @ self.nodes_at(time_s) @ binds
        return np.einsum("nk,nkab->nab", self.weights, matrices[self.joints])

    def vertices_m(self, time_s):
        """Vertices (n, 3) in the world."""
        blended = self.blended(time_s)
        return np.einsum("nab,nb->na", blended[:, :3, :3], self.positions) + blended[:, :3, 3]

    def write(self, path, wall=True, **changes):
        """Write the file: the figure, and a wall behind it."""
        gltf = Animated()
        root = len(JOINTS)
        for number, (name, parent, *_) in enumerate(JOINTS):
            offset = BIND[number] - (0 if parent is None else BIND[parent])
            if parent is None:
                gltf.node(name=name, translation=offset.tolist())
            else:
                gltf.child(parent, name=name, translation=offset.tolist())
        gltf.tree["scenes"][0]["nodes"] = []
        gltf.node(name="figure", translation=FIGURE, children=[0])
        self.accessors = {
            "POSITION": gltf.accessor(self.positions.astype("<f4"), "VEC3"),
            "NORMAL": gltf.accessor(self.normals.astype("<f4"), "VEC3"),
            "JOINTS_0": gltf.accessor(self.joints.astype("u1"), "VEC4"),
            "WEIGHTS_0": gltf.accessor(self.weights.astype("<f4"), "VEC4"),
        }
        indices = gltf.accessor(self.triangles.astype("<u2").ravel(), "SCALAR")
        gltf.tree["materials"] = [
            {"doubleSided": True, "pbrMetallicRoughness": {"baseColorFactor": [0.7, 0.3, 0.2, 1]}}
        ]
        primitive = {"attributes": self.accessors, "indices": indices, "material": 0, **changes}
        gltf.tree["meshes"].append({"primitives": [primitive]})
        binds = np.tile(np.eye(4), (len(JOINTS), 1, 1))
        binds[:, :3, 3] = -BIND
        columns = binds.swapaxes(1, 2).reshape(-1, 16).astype("<f4")
        gltf.tree["skins"] = [
            {"joints": list(range(root)), "inverseBindMatrices": gltf.accessor(columns, "MAT4")}
        ]
        gltf.node(name="walker", mesh=0, skin=0)
        if wall:
            corners = [[4, -3, 9], [4, 9, -9], [4, -3, -9]]
            gltf.node(name="wall", mesh=gltf.triangle(positions=corners, material=0))
        gltf.animate(
            "walk",
            (0, "translation", TIMES_S, BIND[0] + WALK, "LINEAR"),
            *(
                (joint, "rotation", TIMES_S, turns.as_quat(), "LINEAR")
                for joint, turns in self.turns.items()
            ),
        )
        self.gltf = gltf
        return gltf.write(path)
