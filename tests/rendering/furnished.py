"""An L-shaped, furnished room with mirrors, panes, a glossy floor, chrome and glass balls.

All that does not reflect shines in its own color, so that images are the light along reflected and
transmitted rays alone. The room's corner hides parts of it from each viewpoint.
"""

import numpy as np

from omnisim.core.poses import pose
from omnisim.scene.model import Lighting, Material, Mesh
from omnisim.validation import reflective_rooms
from omnisim.validation.material_chart import sphere
from tests.scenes import scene_of

HEIGHT_M, CELL_M = 2.6, 0.6
CHROME = Material("chrome", (0.95, 0.95, 0.95, 1.0), metallic=1.0, roughness=0.0, double_sided=True)
STONE = Material("stone", (0.6, 0.55, 0.5, 1.0), metallic=1.0, roughness=0.15, double_sided=True)
PANE = Material("pane", (0.9, 0.97, 0.95, 1.0), roughness=0.0, specular=1.0, transmission=1.0,
                double_sided=True)  # fmt: skip
GLASS = Material("glass", (0.97, 0.99, 1.0, 1.0), roughness=0.0, specular=1.0, transmission=1.0,
                 thickness_m=0.7, double_sided=True)  # fmt: skip
SHINING = Material("shining", unlit=True)
MATERIALS = (SHINING, CHROME, STONE, PANE, GLASS)
WALLS = [  # start and end in (x, y), inside to the left
    ((-4.0, -3.0), (2.0, -3.0)), ((2.0, -3.0), (2.0, 4.0)), ((2.0, 4.0), (-0.5, 4.0)),
    ((-0.5, 4.0), (-0.5, 0.0)), ((-0.5, 0.0), (-4.0, 0.0)), ((-4.0, 0.0), (-4.0, -3.0)),
]  # fmt: skip
LEVELS = [((-4.0, -3.0), (2.0, 0.0)), ((-0.5, 0.0), (2.0, 4.0))]  # low and high corners in (x, y)
BOXES = {  # low and high corners, and color
    "table": ((-0.9, -1.5, 0.55), (0.5, -0.6, 0.62), (0.65, 0.4, 0.2)),
    "leg": ((-0.3, -1.15, 0.0), (-0.1, -0.95, 0.55), (0.5, 0.3, 0.15)),
    "cupboard": ((-3.2, -0.55, 0.0), (-2.2, -0.02, 1.7), (0.2, 0.45, 0.6)),
    "sofa": ((-2.9, -2.95, 0.0), (-1.3, -2.3, 0.45), (0.7, 0.15, 0.2)),
    "crate": ((1.2, 2.7, 0.0), (1.9, 3.4, 0.7), (0.2, 0.6, 0.25)),
    "stool": ((0.1, 1.9, 0.0), (0.5, 2.3, 0.5), (0.75, 0.65, 0.1)),
}
UPRIGHTS = {  # start and end in (x, y), lower and upper edge
    "east mirror": ((1.99, -2.4), (1.99, -0.5), 0.4, 2.1),
    "west mirror": ((-3.99, -0.7), (-3.99, -2.4), 0.5, 2.0),
    "south mirror": ((-0.6, -2.99), (1.2, -2.99), 0.5, 2.0),
    "corner mirror": ((-0.49, 3.2), (-0.49, 1.0), 0.4, 2.1),
    "north mirror": ((1.6, 3.99), (0.0, 3.99), 0.5, 2.0),
}
PANES = {
    "partition": ((1.95, 0.1), (0.3, 0.1), 0.02, 2.2),
    "screen": ((-1.0, -2.98), (-1.0, -2.1), 0.02, 1.8),
}
BALLS = {"chrome ball": ((-0.55, -1.0, 0.94), 0.3, 1), "glass ball": ((0.15, -1.1, 0.9), 0.27, 4),
         "chrome globe": ((0.5, 2.9, 0.42), 0.4, 1)}  # fmt: skip
VIEWS = {
    "east": pose((-3.2, -1.3, 1.5), yaw_deg=4.0, pitch_deg=12.0),
    "west": pose((1.6, -2.1, 1.5), yaw_deg=160.0, pitch_deg=12.0),
    "north": pose((0.9, -1.9, 1.4), yaw_deg=97.0, pitch_deg=10.0),
    "south": pose((0.2, 3.5, 1.6), yaw_deg=-68.0, pitch_deg=16.0),
}


def furnished_room():
    """The room; instances have the names of `names`."""
    meshes = [_walls(), *(_box(name, *box) for name, box in BOXES.items())]
    meshes += [_upright(name, *upright, 1) for name, upright in UPRIGHTS.items()]
    meshes += [_upright(name, *pane, 3) for name, pane in PANES.items()]
    meshes.append(_floor())
    for name, (center_m, radius_m, material) in BALLS.items():
        ball = sphere(radius_m, 64)
        positions = (ball.positions + np.array(center_m)).astype(np.float32)
        meshes.append(Mesh(name, positions, ball.triangles, material, ball.normals))
    return scene_of(meshes, MATERIALS, None, Lighting((0.45, 0.45, 0.45), ()))


def names():
    """Names of the instances, in their order."""
    return ["walls", *BOXES, *UPRIGHTS, *PANES, "floor", *BALLS]


def camera(width_px, supersampling):
    """Perspective camera of 80° that looks along its base's x."""
    return reflective_rooms.camera(width_px, supersampling)


def _walls():
    quads, colors = [], []

    def add(corner, along, up, tint):
        """Squares of about `CELL_M` on a parallelogram."""
        counts = [max(1, round(np.linalg.norm(side) / CELL_M)) for side in (along, up)]
        for i, j in np.ndindex(*counts):
            u, v = along / counts[0], up / counts[1]
            first = corner + i * u + j * v
            quads.append([first, first + u, first + u + v, first + v])
            middle = first + 0.5 * (u + v)
            shade = 0.45 + 0.2 * np.sin(middle * (1.1, 1.3, 1.9) + tint)
            colors.append(shade + (0.06 if (i + j) % 2 else -0.06))

    for number, (start, end) in enumerate(WALLS):
        first, last = np.array((*start, 0.0)), np.array((*end, 0.0))
        add(last, first - last, np.array((0.0, 0.0, HEIGHT_M)), np.array((0.0, 1.0, 2.0)) + number)
    for (x, y), (far_x, far_y) in LEVELS:
        corner, along = np.array((x, far_y, HEIGHT_M)), np.array((far_x - x, 0.0, 0.0))
        add(corner, along, np.array((0.0, y - far_y, 0.0)), np.array((1.5, 1.7, 1.6)))
    return _quads("walls", quads, colors)


def _box(name, low_m, high_m, color):
    corners = np.array([low_m, high_m])
    quads, colors = [], []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            quad = np.empty((4, 3))
            quad[:, axis] = corners[side, axis]
            quad[:, first] = corners[[0, 1, 1, 0], first]
            quad[:, second] = corners[[0, 0, 1, 1], second]
            quads.append(quad if side else quad[::-1])
            colors.append(np.array(color) * (0.6 + 0.15 * axis + 0.1 * side))
    return _quads(name, quads, colors)


def _quads(name, quads, colors):
    corners = np.array(quads, dtype=np.float32).reshape(-1, 3)
    first = 4 * np.arange(len(quads), dtype=np.uint32)[:, None, None]
    triangles = (first + np.array(((0, 1, 2), (0, 2, 3)), dtype=np.uint32)).reshape(-1, 3)
    rgba = np.concatenate((np.clip(colors, 0.02, 0.95), np.ones((len(quads), 1))), axis=1)
    return Mesh(name, corners, triangles, 0, colors=np.repeat(rgba, 4, axis=0).astype(np.float32))


def _upright(name, start, end, low_m, high_m, material):
    corners = [(*start, low_m), (*end, low_m), (*end, high_m), (*start, high_m)]
    triangles = np.array(((0, 1, 2), (0, 2, 3)), dtype=np.uint32)
    return Mesh(name, np.array(corners, dtype=np.float32), triangles, material)


def _floor():
    corners, triangles = [], []
    for number, ((x, y), (far_x, far_y)) in enumerate(LEVELS):
        corners += [(x, y, 0.0), (far_x, y, 0.0), (far_x, far_y, 0.0), (x, far_y, 0.0)]
        triangles += [(4 * number + i, 4 * number + j, 4 * number + k)
                      for i, j, k in ((0, 1, 2), (0, 2, 3))]  # fmt: skip
    return Mesh("floor", np.array(corners, np.float32), np.array(triangles, np.uint32), 2)
