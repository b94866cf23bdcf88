"""A chessboard of 9 × 7 squares, made with trimesh: `python examples/make_board.py board.glb 0.04`.

It lies on the floor, its middle at the origin; a white border is one square wide.
"""

import sys

import numpy as np
import trimesh

COLUMNS, ROWS = 9, 7
WHITE, BLACK = (255, 255, 255, 255), (10, 10, 10, 255)


def main(path: str, square_m: float) -> None:
    """Write the board."""
    corners, colors = [], []
    for row in range(-1, ROWS + 1):
        for column in range(-1, COLUMNS + 1):
            x, y = column - 0.5 * COLUMNS, row - 0.5 * ROWS
            # glTF's y is up
            corners += [(x, 0, -y), (x + 1, 0, -y), (x + 1, 0, -y - 1), (x, 0, -y - 1)]
            inside = 0 <= row < ROWS and 0 <= column < COLUMNS
            colors += 4 * [BLACK if inside and (row + column) % 2 == 0 else WHITE]
    first = 4 * np.arange(len(corners) // 4)[:, None]
    faces = np.concatenate((first + (0, 1, 2), first + (0, 2, 3)))
    board = trimesh.Trimesh(square_m * np.array(corners), faces, process=False)
    board.visual.vertex_colors = np.array(colors, dtype=np.uint8)
    scene = trimesh.Scene()
    scene.add_geometry(board, node_name="board")
    scene.export(path)


if __name__ == "__main__":
    main(
        sys.argv[1] if len(sys.argv) > 1 else "board.glb",
        float(sys.argv[2]) if len(sys.argv) > 2 else 0.04,
    )
