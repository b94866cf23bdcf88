"""Comparison of two OpenGL drivers: `python -m tests.drivers virgl --poses 100`."""

import argparse
import sys
import tempfile
from functools import partial
from pathlib import Path

from tests.drivers.bounds import compare
from tests.drivers.cases import all_cases
from tests.drivers.processes import LLVMPIPE_LIKE_VIRGL, draw_by, draw_by_virgl


def main() -> None:
    """Compare, case by case; exit status 1 where something is not within the bounds."""
    parser = argparse.ArgumentParser(prog="python -m tests.drivers", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    virgl = commands.add_parser("virgl", help="llvmpipe alone, and virgl in front of it")
    virgl.add_argument("--poses", type=int, default=100, help="of each case")
    virgl.add_argument("--size", type=int, default=96, help="of the images, in pixels")
    drawn = commands.add_parser("compare", help="two folders of `python -m tests.drivers.draw`")
    drawn.add_argument("one", type=Path)
    drawn.add_argument("other", type=Path)
    options = parser.parse_args()
    if options.command == "virgl":
        sys.exit(not _virgl(options.poses, options.size))
    sys.exit(not compare(options.one, options.other, partial(print, flush=True)))


def _virgl(poses: int, size_px: int) -> bool:
    """Draw every case by both drivers, with a new server for each."""
    within = True
    for name in all_cases(size_px, poses):
        drawing = ("--poses", str(poses), "--size", str(size_px), "--cases", name)
        with tempfile.TemporaryDirectory(prefix="omnisim-drivers-") as folder:
            one, other = Path(folder) / "llvmpipe", Path(folder) / "virgl"
            draw_by(LLVMPIPE_LIKE_VIRGL, one, *drawing)
            draw_by_virgl(other, *drawing)
            within = compare(one, other, partial(print, flush=True)) and within
    return within


if __name__ == "__main__":
    main()
