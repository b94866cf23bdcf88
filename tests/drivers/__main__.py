"""Comparison of OpenGL drivers: `python -m tests.drivers virgl --poses 100`, or `gpu`."""

import argparse
import signal
import sys
import tempfile
from functools import partial
from pathlib import Path

from tests.drivers.bounds import compare
from tests.drivers.cases import all_cases
from tests.drivers.gpu import SECONDS
from tests.drivers.processes import LLVMPIPE_LIKE_VIRGL, draw_by, draw_by_virgl

print_line = partial(print, flush=True)


def main() -> None:
    """Compare, case by case, or check a graphics card; exit status 1 if anything is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.drivers", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    virgl = commands.add_parser("virgl", help="llvmpipe alone, and virgl in front of it")
    virgl.add_argument("--poses", type=int, default=100, help="of each case")
    virgl.add_argument("--size", type=int, default=96, help="of the images, in pixels")
    drawn = commands.add_parser("compare", help="two folders of `python -m tests.drivers.draw`")
    drawn.add_argument("one", type=Path)
    drawn.add_argument("other", type=Path)
    gpu = commands.add_parser("gpu", help="check of this machine's graphics card in minutes")
    gpu.add_argument("--out", type=Path, default=Path("out") / "gpu.tar", help="all results")
    gpu.add_argument("--seconds", type=float, default=SECONDS, help="limit; the rest is skipped")
    gpu.add_argument("--only", nargs="+", default=[], metavar="STEP", help="names begin so")
    gpu.add_argument("--scale", type=float, default=1.0, help="share of the images, such as 0.1")
    options = parser.parse_args()
    if options.command == "virgl":
        sys.exit(not _virgl(options.poses, options.size))
    if options.command == "compare":
        sys.exit(not compare(options.one, options.other, print_line))
    sys.exit(not _gpu(options))


def _virgl(poses: int, size_px: int) -> bool:
    """Draw every case by both drivers, with a new server for each."""
    within = True
    for name in all_cases(size_px, poses):
        drawing = ("--poses", str(poses), "--size", str(size_px), "--cases", name)
        with tempfile.TemporaryDirectory(prefix="omnisim-drivers-") as folder:
            one, other = Path(folder) / "llvmpipe", Path(folder) / "virgl"
            draw_by(LLVMPIPE_LIKE_VIRGL, one, *drawing)
            draw_by_virgl(other, *drawing)
            within = compare(one, other, print_line) and within
    return within


def _gpu(options: argparse.Namespace) -> bool:
    """Check the graphics card."""
    from tests.drivers.gpu.plan import check_gpu  # its cases import more than others need

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # then a summary is written, too
    try:
        return check_gpu(options.out, options.seconds, options.only, options.scale, print_line)
    except ValueError as reason:
        sys.exit(f"error: {reason}")


if __name__ == "__main__":
    main()
