"""Long runs of what must not wear out: `python -m tests.soak WHAT --times 200`."""

import argparse
import sys
import tempfile
from functools import partial
from pathlib import Path

from tests.soak.frames import SCENES, frames
from tests.soak.kills import kills
from tests.soak.live import MAX_GROWTH as LIVE_GROWTH
from tests.soak.live import live
from tests.soak.renderers import MAX_GROWTH, renderers


def main() -> None:
    """Run one; exit status 1 where it fails."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("what", choices=("kills", "renderers", "frames", "live"))
    parser.add_argument("--times", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the kills' moments, and of actions")
    parser.add_argument("--scene", choices=SCENES, default="sheets", help="of the frames")
    parser.add_argument("--output", type=Path, help="for the runs; a temporary folder")
    options = parser.parse_args()
    print_line = partial(print, flush=True)
    if options.what == "renderers":
        growth = renderers(options.times, print_line)
        print(f"{options.times} renderers: {growth / 1e3:+.0f} kB each")
        sys.exit(growth > MAX_GROWTH)
    if options.what == "frames":
        grown = frames(options.times, options.scene, print_line)
        print(f"{options.times} frames: {grown.memory / 1e6:+.1f} MB, {dict(grown.objects)}")
        sys.exit(not grown.is_flat)
    if options.what == "live":
        growth = live(options.times, options.seed, print_line)
        print(f"{options.times} actions: {growth / 1e6:+.1f} MB")
        sys.exit(growth > LIVE_GROWTH)
    with tempfile.TemporaryDirectory(prefix="omnisim-kills-") as folder:
        kills(options.output or Path(folder), options.times, options.seed, print_line)


if __name__ == "__main__":
    main()
