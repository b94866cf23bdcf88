"""Waypoints from a file: our CSV with nothing but x_m and y_m."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import TrajectoryError
from omnisim.robot.formats.text_table import read_text_table
from omnisim.robot.waypoints import check_waypoints


def read_waypoints(path: Path) -> NDArray[np.float64] | None:
    """Waypoints (n, 2) of a CSV file that has the columns x_m and y_m and no others, or None: it
    is something else.

    Places alone say where a robot is to drive; headings or times say how it did.

    Raises:
        TrajectoryError: naming file, line, what was found and what was wanted.
    """
    table = read_text_table(path)
    names = table.lines[0].cells
    if sorted(names) != ["x_m", "y_m"]:
        return None
    numbers = table.without_header().numbers(names)
    try:
        return check_waypoints(numbers[:, [names.index("x_m"), names.index("y_m")]])
    except TrajectoryError as reason:
        raise TrajectoryError(f"{path}: {reason}") from None
