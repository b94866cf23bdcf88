"""A ball with stripes, made with trimesh: `python examples/make_ball.py ball.glb 0.11`."""

import sys

import numpy as np
import trimesh

ORANGE, BLACK = (255, 140, 20, 255), (20, 20, 20, 255)


def main(path: str, radius_m: float) -> None:
    """Write the ball, its middle at the origin."""
    ball = trimesh.creation.icosphere(4, radius_m)
    normals = ball.face_normals
    ball.unmerge_vertices()
    is_dark = np.abs(normals @ np.eye(3)).min(axis=1) < 0.15
    colors = np.where(is_dark[:, None], BLACK, ORANGE).astype(np.uint8)
    ball.visual.vertex_colors = np.repeat(colors, 3, axis=0)
    scene = trimesh.Scene()
    scene.add_geometry(ball, node_name="ball")
    scene.export(path)


if __name__ == "__main__":
    main(
        sys.argv[1] if len(sys.argv) > 1 else "ball.glb",
        float(sys.argv[2]) if len(sys.argv) > 2 else 0.11,
    )
