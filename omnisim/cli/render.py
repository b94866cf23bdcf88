"""`omnisim render`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from omnisim.atomic_file import check_distinct, check_target
from omnisim.cli.options import load_labelled_scene, parse_polygons, read_camera, read_preset
from omnisim.errors import OutputError
from omnisim.ground_truth import parse_channels
from omnisim.ground_truth.files import is_name_beside
from omnisim.image_files import is_float_format, write_image
from omnisim.sensors import OmniCamera, Renderer
from omnisim.sensors.motion import FASTEST_MPS, FASTEST_RADPS, Twist
from omnisim.sensors.renderer import unfolded_cube

if TYPE_CHECKING:  # slow to import, and seldom needed
    from omnisim.calibration import Calibration


@dataclass(frozen=True)
class RenderRequest:
    """The arguments of the command, as its help explains them."""

    scene: str
    output: Path
    sensor: Path | None
    calibration: Path | None
    camera_name: str | None
    mirrored: bool | None
    at: tuple[float, float, float] | None
    yaw_deg: float | None
    polygons: str | None
    size_px: int | None
    unlit: bool
    faces: Path | None
    up_axis: str | None
    device: int | None
    also: str | None = None
    labels: Path | None = None
    next_at: tuple[float, float, float] | None = None
    next_yaw_deg: float | None = None
    preview: bool = False
    preset: str | None = None
    seed: int = 0
    speed_mps: float = 0.0
    turn_rate_degps: float = 0.0
    rays: Path | None = None
    calibration_beside: Path | None = None
    quality: str | None = None


DEFAULT_AHEAD_M = 0.1  # from a picture to the next, where flow is asked for and nobody says


def run(request: RenderRequest, out: Console, err: Console) -> None:
    """Render one frame and say where it is.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    for option, value, most in (
        ("--speed", request.speed_mps, FASTEST_MPS),
        ("--turn-rate", request.turn_rate_degps, math.floor(math.degrees(FASTEST_RADPS))),
    ):
        if not abs(value) <= most:  # NaN is not, either
            raise OutputError(f"{option} {value:g}: want a number from −{most:g} to {most:g}")
    is_float = is_float_format(request.output)
    check_target(request.output)
    for path in (request.rays, request.calibration_beside):
        if path is not None:
            check_target(path)
    beside = {"--rays": request.rays, "--calibration": request.calibration_beside}
    check_distinct(
        {"the picture": request.output, **beside},
        {
            "the scene": Path(request.scene),
            "the camera's file": request.calibration,
            "the sensor file": request.sensor,
            "the labels' file": request.labels,
        },
    )
    also = () if request.also is None else parse_channels(request.also)
    for option, path in beside.items():
        if also and path is not None and is_name_beside(request.output, path):
            raise OutputError(
                f"{path}: is a file of --also already: want another name for {option}"
            )
    if request.rays is not None and request.rays.suffix.lower() != ".exr":
        raise OutputError(f"{request.rays}: rays are written as .exr")
    if request.faces is not None:
        check_target(request.faces / "front.png", may_make_folder=True)
    camera = read_camera(
        request.sensor, request.calibration, request.camera_name, request.mirrored, err
    )
    degradation = read_preset(request.preset)
    if degradation is not None:
        camera = camera.with_degradation(degradation)
    if request.size_px is not None:
        camera = camera.resized(request.size_px)
    if request.quality is not None:
        camera = camera.with_quality(request.quality)
    if request.polygons is not None:
        camera = camera.with_polygons(parse_polygons(request.polygons))
    _check_also(request, also)
    scene = load_labelled_scene(request.scene, request.up_axis, request.labels, also, err)
    position = scene.start.position_m if request.at is None else request.at
    yaw_deg = scene.start.yaw_deg if request.yaw_deg is None else request.yaw_deg
    pose = camera.base_pose(position, yaw_deg)
    next_position, next_yaw_deg = _next(request, position, yaw_deg)
    next_pose = camera.base_pose(next_position, next_yaw_deg) if "flow" in also else None
    turn_rate_radps = math.radians(request.turn_rate_degps)
    shutter = camera.degradation.shutter
    if (request.speed_mps or turn_rate_radps) and not (shutter and shutter.duration_s):
        err.print("note: this camera's shutter takes no time: no motion shows", markup=False)
    twist = Twist((request.speed_mps, 0.0, 0.0), (0.0, 0.0, turn_rate_radps))
    with Renderer(
        scene, camera, unlit=request.unlit, device=request.device, seed=request.seed
    ) as renderer:
        frame = renderer.render(
            pose, linear=is_float, also=also, next_base=next_pose, motion=twist.through(pose)
        )
        faces = renderer.faces() if request.faces is not None else {}
    frame.save(request.output, previews=request.preview)
    if request.rays is not None:
        from omnisim.calibration.ray_table import write_ray_table

        write_ray_table(request.rays, camera.model, frame.metadata)
    if request.calibration_beside is not None:
        _calibration(camera, pose).save(request.calibration_beside, "omnisim")
    x, y, z = position
    out.print(
        f"{request.output}: {camera.model.width_px} × {camera.model.height_px} px, "
        f"{camera.polygons or 'exact'}{' polygons' if camera.polygons else ''}, "
        f"from ({x:g}, {y:g}, {z:g}) m at yaw {yaw_deg:g}°",
        markup=False,
    )
    for path, what in (
        (request.rays, "a ray of each pixel"),
        (request.calibration_beside, "camera and pose"),
    ):
        if path is not None:
            out.print(f"{path}: {what}", markup=False)
    if also:
        told = f"{request.output}: also {', '.join(also)}"
        if next_pose is not None:
            x, y, z = next_position
            is_ours = request.next_at is None and request.next_yaw_deg is None
            why = f", {DEFAULT_AHEAD_M:g} m ahead as no --next says" if is_ours else ""
            told += f"; flow to ({x:g}, {y:g}, {z:g}) m at yaw {next_yaw_deg:g}°{why}"
        out.print(told, markup=False)
    if request.faces is not None:
        _make_folder(request.faces)
        for name, pixels in faces.items():
            write_image(request.faces / f"{name}.png", pixels)
        write_image(request.faces / "unfolded.png", unfolded_cube(faces))
        out.print(f"{request.faces}: {', '.join(faces)}, unfolded", markup=False)


def _calibration(sensor: OmniCamera, world_from_base: NDArray[np.float64]) -> Calibration:
    """The camera, where it is on its vehicle, and where the vehicle is."""
    from omnisim.calibration import CalibratedCamera, Calibration, Pose

    poses = (
        Pose("base", "camera", sensor.base_from_optical),
        Pose("world", "base", world_from_base),
    )
    return Calibration((CalibratedCamera("camera", sensor.model, poses),))


def _check_also(request: RenderRequest, also: tuple[str, ...]) -> None:
    """Refuse options that would be forgotten.

    Raises:
        OutputError: an option of channels that are not asked for.
    """
    needs = (
        ("--next", request.next_at is not None, "flow"),
        ("--next-yaw", request.next_yaw_deg is not None, "flow"),
    )
    for option, is_given, channel in needs:
        if is_given and channel not in also:
            raise OutputError(f"{option}: is for the channel {channel}: want --also {channel}")
    if request.preview and not also:
        raise OutputError("--preview: shows channels: want --also with their names")


def _next(
    request: RenderRequest, position: tuple[float, float, float], yaw_deg: float
) -> tuple[tuple[float, float, float], float]:
    """Where the next picture is taken, and at what heading."""
    next_yaw_deg = yaw_deg if request.next_yaw_deg is None else request.next_yaw_deg
    if request.next_at is not None:
        return request.next_at, next_yaw_deg
    if request.next_yaw_deg is not None:
        return position, next_yaw_deg
    yaw, (x, y, z) = math.radians(yaw_deg), position
    ahead = (x + DEFAULT_AHEAD_M * math.cos(yaw), y + DEFAULT_AHEAD_M * math.sin(yaw), z)
    return ahead, next_yaw_deg


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{path}: this folder cannot be made: {reason.strerror}") from None
