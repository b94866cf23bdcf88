"""`omnisim render`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from omnisim.atomic_file import check_target
from omnisim.cli.options import parse_polygons, read_preset, read_sensor
from omnisim.errors import OutputError
from omnisim.image_files import is_float_format, write_image
from omnisim.scene import load_scene
from omnisim.sensors import Renderer
from omnisim.sensors.motion import Twist
from omnisim.sensors.renderer import unfolded_cube


@dataclass(frozen=True)
class RenderRequest:
    """The arguments of the command, as its help explains them."""

    scene: str
    output: Path
    sensor: Path | None
    at: tuple[float, float, float] | None
    yaw_deg: float | None
    polygons: str | None
    size_px: int | None
    unlit: bool
    faces: Path | None
    up_axis: str | None
    device: int | None
    preset: str | None
    seed: int
    speed_mps: float
    turn_rate_degps: float


def run(request: RenderRequest, out: Console, err: Console) -> None:
    """Render one frame and say where it is.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    for option, value in (("--speed", request.speed_mps), ("--turn-rate", request.turn_rate_degps)):
        if not math.isfinite(value):
            raise OutputError(f"{option} {value:g}: want a finite number")
    is_float = is_float_format(request.output)
    check_target(request.output)
    if request.faces is not None:
        check_target(request.faces / "front.png", may_make_folder=True)
    camera = read_sensor(request.sensor)
    degradation = read_preset(request.preset)
    if degradation is not None:
        camera = camera.with_degradation(degradation)
    if request.size_px is not None:
        camera = camera.resized(request.size_px)
    if request.polygons is not None:
        camera = camera.with_polygons(parse_polygons(request.polygons))
    scene = load_scene(request.scene, request.up_axis)
    for notice in scene.notices:
        err.print("note: ", notice, sep="", markup=False)
    position = scene.start.position_m if request.at is None else request.at
    yaw_deg = scene.start.yaw_deg if request.yaw_deg is None else request.yaw_deg
    pose = camera.base_pose(position, yaw_deg)
    turn_rate_radps = math.radians(request.turn_rate_degps)
    shutter = camera.degradation.shutter
    if (request.speed_mps or turn_rate_radps) and not (shutter and shutter.duration_s):
        err.print("note: this camera's shutter takes no time: no motion shows", markup=False)
    twist = Twist((request.speed_mps, 0.0, 0.0), (0.0, 0.0, turn_rate_radps))
    with Renderer(
        scene, camera, unlit=request.unlit, device=request.device, seed=request.seed
    ) as renderer:
        frame = renderer.render(pose, linear=is_float, motion=twist.through(pose))
        faces = renderer.faces() if request.faces is not None else {}
    frame.save(request.output)
    x, y, z = position
    out.print(
        f"{request.output}: {camera.camera.width_px} × {camera.camera.height_px} px, "
        f"{camera.polygons or 'exact'}{' polygons' if camera.polygons else ''}, "
        f"from ({x:g}, {y:g}, {z:g}) m at yaw {yaw_deg:g}°",
        markup=False,
    )
    if request.faces is not None:
        _make_folder(request.faces)
        for name, pixels in faces.items():
            write_image(request.faces / f"{name}.png", pixels)
        write_image(request.faces / "unfolded.png", unfolded_cube(faces))
        out.print(f"{request.faces}: {', '.join(faces)}, unfolded", markup=False)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{path}: this folder cannot be made: {reason.strerror}") from None
