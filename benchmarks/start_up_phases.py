"""Phases of `omnisim render SCENE` until its first frame is written, timed.

Run in a new process: `python -m benchmarks.start_up_phases START SCENE FILE [DEVICE]`, with START
the monotonic clock at the start of the process. Prints seconds by phase as JSON.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

BEFORE = "Python itself"
IMPORTS, SCENE, CONTEXT, UPLOAD = "imports", "scene", "OpenGL", "upload"
COMPILE, FRAME, WRITE = "shaders and targets", "first frame", "file"
AFTER = "end"  # end of the process: time that the parent measures beyond all other phases
PHASES = (BEFORE, IMPORTS, SCENE, CONTEXT, UPLOAD, COMPILE, FRAME, WRITE, AFTER)


def main(start: float, scene_name: str, path: str, device: int | None) -> dict[str, float]:
    """Render, and return the seconds of each phase."""
    seconds: dict[str, float] = {}
    last = start

    def done(phase: str) -> None:
        nonlocal last
        now = time.monotonic()
        seconds[phase] = now - last
        last = now

    done(BEFORE)
    import omnisim.apps.cli.app
    import omnisim.apps.cli.images.render  # noqa: F401
    from omnisim.rendering.camera.omnicamera import OmniCamera
    from omnisim.rendering.opengl import cube_backend
    from omnisim.rendering.stage import Stage
    from omnisim.scene import load_scene

    done(IMPORTS)
    scene = load_scene(scene_name)
    done(SCENE)
    open_context = vars(cube_backend)["open_context"]

    def timed(*arguments: Any, **options: Any) -> Any:
        context = open_context(*arguments, **options)
        done(CONTEXT)
        return context

    vars(cube_backend)["open_context"] = timed
    with Stage(scene, device=device) as on_stage:
        done(UPLOAD)
        camera = OmniCamera()
        with on_stage.open(camera) as renderer:
            done(COMPILE)
            frame = renderer.render(
                camera.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
            )
            done(FRAME)
            frame.save(path)
            done(WRITE)
    return seconds


if __name__ == "__main__":
    _, begun, name, file, *number = sys.argv
    print(json.dumps(main(float(begun), name, file, int(number[0]) if number else None)))
