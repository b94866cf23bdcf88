"""Render README's image of several robots: `python .ci/make_world_image.py FILE`.

Left, what the first robot's camera sees: the second robot, and a ball that rolls. Right, the point
cloud of its lidar from above, at the same time.
"""

import runpy
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import omnisim
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar

ROOT = Path(__file__).resolve().parents[1]
TOML = """
extends = "soccer"
[[objects]]
name = "ball"
file = "ball.glb"
rolling_radius_m = 0.11
orbit = { center_m = [0.4, 0.2, 0.11], radius_m = 0.7, period_s = 6.0, start_deg = 63.0 }
"""
BASE_FROM_LIDAR = pose((0.05, 0.0, 0.75))
FIRST, SECOND = pose((-0.9, -0.5, 0.0), yaw_deg=25.0), pose((0.6, 0.7, 0.0), yaw_deg=215.0)
NOW_S = 4.2


def main(path: str) -> None:
    """Write the image."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_ball = runpy.run_path(str(ROOT / "examples" / "make_ball.py"))["main"]
        make_ball(str(folder / "ball.glb"), 0.11)
        (folder / "match.toml").write_text(TOML)
        scene = omnisim.load_scene(folder / "match.toml")
    first, second = omnisim.Vehicle.load("p2at"), omnisim.Vehicle.load("superscout")

    def motion(time_s):
        turn = pose(yaw_deg=20.0 * (time_s - NOW_S))
        return WorldState({"p2at": FIRST @ turn, "superscout": SECOND}, time_s)

    bodies = {"p2at": first.body, "superscout": second.body}
    with omnisim.Stage(scene, vehicles=bodies) as stage:
        camera = first.camera().sensor.resized(720)
        image = stage.open(camera, vehicle="p2at").render(motion(NOW_S)).rgb
        lidar = SpinningLidar.hdl64e()
        renderer = stage.open(lidar, base_from_sensor=BASE_FROM_LIDAR, vehicle="p2at",
            hidden={one.name for one in first.body.instances},
        )  # fmt: skip
        cloud = renderer.scan(motion, NOW_S)
    points = world_points(cloud, motion)
    figure = Figure(figsize=(14.4, 7.2), dpi=100, facecolor="black")
    left = figure.add_axes((0.0, 0.0, 0.5, 1.0))
    left.imshow(image)
    right = figure.add_axes((0.5, 0.0, 0.5, 1.0))
    order = np.argsort(points[:, 2])
    x, y, z = points[order].T
    right.scatter(-y, x, c=np.clip(z, 0.0, 1.6), s=1.0, cmap="turbo", linewidths=0)
    length_m, width_m = first.footprint.length_m, first.footprint.width_m
    corners = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (length_m, width_m)
    outline = corners @ FIRST[:2, :2].T + FIRST[:2, 3]
    right.fill(-outline[:, 1], outline[:, 0], facecolor="none", edgecolor="white")
    ahead = FIRST[:2, :2] @ (0.5 * length_m, 0.0) + FIRST[:2, 3]
    right.plot((-FIRST[1, 3], -ahead[1]), (FIRST[0, 3], ahead[0]), color="white", linewidth=1.0)
    for axes in (left, right):
        axes.set_axis_off()
    right.set_aspect("equal")
    right.set_xlim(-4.2, 4.2)
    right.set_ylim(-4.2, 4.2)
    figure.savefig(path, facecolor="black", pil_kwargs={"quality": 88})


def world_points(cloud, motion):
    """Points (n, 3) in the world, each at its own time."""
    start_s = NOW_S - cloud.lidar.period_s
    times, inverse = np.unique(cloud.points["time"], return_inverse=True)
    poses = np.stack(
        [motion(start_s + float(t)).world_from_object["p2at"] @ BASE_FROM_LIDAR for t in times]
    )[inverse]
    return (poses[:, :3, :3] @ cloud.points_m[:, :, None])[..., 0] + poses[:, :3, 3]


if __name__ == "__main__":
    main(sys.argv[1])
