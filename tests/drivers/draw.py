"""Drawing of the cases by one driver: `python -m tests.drivers.draw --folder FOLDER`."""

import argparse
import time
from pathlib import Path

import numpy as np

from omnisim.rendering.opengl.gl.context import graphics_info, open_context
from tests.drivers.cases import all_cases
from tests.drivers.sample import sample_cases
from tests.drivers.shader_sources import collected_shaders


def main() -> None:
    """Draw into files of a folder."""
    parser = argparse.ArgumentParser(prog="python -m tests.drivers.draw", description=__doc__)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--poses", type=int, default=2, help="of each case")
    parser.add_argument("--size", type=int, default=96, help="of the images, in pixels")
    parser.add_argument("--sample", action="store_true", help="other lights and sensors, too")
    parser.add_argument("--cases", nargs="+", metavar="NAME", help="only these")
    parser.add_argument("--shaders", type=Path, help="folder for what is compiled")
    options = parser.parse_args()
    cases = all_cases(options.size, options.poses)
    if options.sample:
        cases |= sample_cases(options.size, options.poses)
    options.folder.mkdir(parents=True, exist_ok=True)
    print(_driver(), flush=True)
    with collected_shaders(options.shaders):
        for name in options.cases or cases:
            start_s = time.monotonic()
            np.savez(options.folder / f"{name}.npz", **cases[name]())
            print(f"{time.monotonic() - start_s:6.1f} s  {name}", flush=True)


def _driver() -> str:
    context = open_context()
    info = graphics_info(context)
    context.release()
    return f"{info.renderer}, OpenGL {info.version}"


if __name__ == "__main__":
    main()
