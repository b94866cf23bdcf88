"""`omnisim render`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import out, pluralize, print_note
from omnisim.apps.cli.images.image_requests import RenderRequest
from omnisim.apps.cli.inputs import (
    Viewpoint,
    check_seconds,
    checked_backend,
    load_labeled_scene,
    parse_channel_format,
    parse_polygons,
    read_camera,
    read_preset,
    refuse_options,
)
from omnisim.cameras import NonCentralCamera, check_central
from omnisim.core.cube import FACE_NAMES, unfolded_cube
from omnisim.core.errors import OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_distinct, check_target
from omnisim.core.files.image_files import is_float_format, write_image
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS, parse_channels
from omnisim.ground_truth.channel_files import (
    BOXES_3D,
    FINEST_RANGE_STEPS_PER_M,
    is_sidecar_name,
    range_steps_per_m,
    sidecar_path,
)
from omnisim.ground_truth.npy import ChannelFormat
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.missed_surfaces import near_plane_note
from omnisim.rendering.stage import open_sensor
from omnisim.rendering.twist import MAX_MPS, MAX_RADPS, Twist

if TYPE_CHECKING:  # slow to import, and seldom needed
    from omnisim.cameras.calibration import Calibration
    from omnisim.robots.vehicle import Vehicle

TRAJECTORY_OPTIONS = {
    "--trajectory-frame": "trajectory_frame",
    "--axes": "axes",
    "--rate": "rate_hz",
    "--force": "force",
}
SIGNS = {"next": 1.0, "previous": -1.0}  # of times
DEFAULT_ADVANCE_M = 0.1  # from a frame to the next, for flow without --next


def run(request: RenderRequest) -> None:
    """Render one frame, or a rig along a trajectory, and print a summary."""
    if request.trajectory is not None:
        from omnisim.apps.cli.images.trajectory import run as run_trajectory

        return run_trajectory(request, request.trajectory)
    refuse_options(request, TRAJECTORY_OPTIONS, "requires --trajectory")
    backend = checked_backend(request)
    if backend == "rays" and request.faces is not None:
        raise OutputError("--faces: expected --backend cube, got --backend rays")
    _check_motion(request)
    is_float = is_float_format(request.output)
    channels = _check_outputs(request)
    vehicle = _vehicle(request)
    camera = _camera(request, vehicle)
    _check_channel_options(request, channels)
    channel_format = parse_channel_format(request.channel_format, channels)
    scene = load_labeled_scene(request, channels)
    viewpoint = Viewpoint.in_scene(scene, request)
    base = viewpoint.base_of(camera)
    others = _other_viewpoints(request, viewpoint, channels)
    bases = {other: there.base_of(camera) for other, there in others.items()}
    twist = _twist(request, camera).through(base)
    time_s = check_seconds("--time", request.time_s)
    interval_s = check_seconds("--interval", request.interval_s)
    with open_sensor(
        scene,
        camera,
        body=None if vehicle is None else vehicle.body,
        hidden=() if vehicle is None else vehicle.camera(_robot_camera(request)).hides,
        unlit=request.unlit,
        device=request.device,
        seed=request.seed,
        backend=backend,
    ) as renderer:
        if renderer.camera.near_m < camera.near_m:
            print_note(
                f"{request.scene}: is small: the near plane is at {renderer.camera.near_m:.3g} m "
                f"instead of {camera.near_m:g} m (virtual_cameras.near_m of a sensor file)"
            )
        if note := near_plane_note(scene, camera, base):
            print_note(f"{request.scene}: {note}")
        states = {
            other: WorldState({renderer.vehicle: there}, time_s + SIGNS[other] * interval_s)
            for other, there in bases.items()
        }
        frame = renderer.render(
            WorldState({renderer.vehicle: base}, time_s),
            linear=is_float,
            also=channels,
            boxes_3d=request.boxes_3d,
            next_state=states.get("next"),
            previous_state=states.get("previous"),
            motion=lambda now_s: twist(now_s - time_s),
        )
        faces = {} if request.faces is None else renderer.faces()
    frame.save(request.output, request.preview, channel_format)
    size = f"{camera.model.width_px} × {camera.model.height_px} px"
    out.print(f"{request.output}: {size}, {camera.mesh_summary}, from {viewpoint}", markup=False)
    if request.rays is not None:
        from omnisim.cameras.calibration.ray_table import write_ray_table

        write_ray_table(request.rays, camera.model, frame.metadata)
        out.print(f"{request.rays}: a ray of each pixel", markup=False)
    if request.calibration is not None:
        calibration = _calibration(camera, base)
        calibration.save(request.calibration, "omnisim")
        out.print(f"{request.calibration}: camera and pose", markup=False)
        for note in calibration.notes:
            print_note(f"{request.calibration}: {note}")
    if channels:
        flows = "".join(_flow_summary(request, *other) for other in others.items())
        out.print(f"{request.output}: also {', '.join(channels)}{flows}", markup=False)
    if request.boxes_3d and frame.boxes_3d is not None:
        boxes = pluralize(len(frame.boxes_3d), "instance")
        out.print(f"{sidecar_path(request.output, BOXES_3D)}: 3-D boxes of {boxes}", markup=False)
    if "range" in channels and not is_float and channel_format is not ChannelFormat.NPY:
        _note_coarse_ranges(request.output, frame.channels["range"])
    if request.faces is not None:
        _write_faces(request.faces, faces)


def _check_motion(request: RenderRequest) -> None:
    for option, value, limit in (
        ("--speed", request.speed_mps, MAX_MPS),
        ("--turn-rate", request.turn_rate_degps, math.floor(math.degrees(MAX_RADPS))),
    ):
        if not abs(value) <= limit:  # NaN is not, either
            raise OutputError(
                f"{option}: expected a number from −{limit:g} to {limit:g}, got {value:g}"
            )


def _check_outputs(request: RenderRequest) -> tuple[str, ...]:
    """Check the files that are going to be written, and return the channels among them.

    Raises:
        OutputError: a file that cannot be written, or would overwrite another.
    """
    check_target(request.output)
    extra = {"--rays": request.rays, "--calibration": request.calibration}
    for path in extra.values():
        if path is not None:
            check_target(path)
    check_distinct(
        {"the image": request.output, **extra},
        {
            "the scene": Path(request.scene),
            "the camera's file": request.camera,
            "the sensor file": request.sensor,
            "the optics file": request.optics,
            "the labels' file": request.labels,
            "the sky": None if request.sky is None else Path(request.sky),
        },
    )
    channels = () if request.also is None else parse_channels(request.also)
    for option, path in extra.items():
        if (
            (channels or request.boxes_3d)
            and path is not None
            and is_sidecar_name(request.output, path)
        ):
            raise OutputError(f"{option}: expected another name than a channel's file, got {path}")
    if request.calibration is not None:
        from omnisim.cameras.calibration import check_calibration_suffix

        check_calibration_suffix(request.calibration, "omnisim")
    if request.rays is not None and request.rays.suffix.lower() != ".exr":
        raise OutputError(f"--rays: expected an .exr file, got {request.rays}")
    if request.faces is not None:
        faces = [request.faces / f"{name}.png" for name in (*FACE_NAMES, "unfolded")]
        check_target(faces[0], may_make_folder=True)
        check_distinct(
            {f"the face {face.stem}": face for face in faces}, {"the image": request.output}
        )
    return channels


def _check_channel_options(request: RenderRequest, channels: Collection[str]) -> None:
    """Refuse options of channels that are not asked for: they would have no effect."""
    others = {CHANNELS[name].other for name in channels}
    for other, channel in (("next", "flow"), ("previous", "flow_backward")):
        for option, value in _other_options(request, other).items():
            if value is not None and other not in others:
                raise OutputError(f"{option}: requires --also {channel}")
    if request.preview and not channels:
        raise OutputError("--preview: requires --also")


def _vehicle(request: RenderRequest) -> Vehicle | None:
    if request.robot is None:
        return None
    from omnisim.robots.vehicle import Vehicle  # few images have one

    return Vehicle.load(request.robot)


def _has_own_camera(request: RenderRequest) -> bool:
    return (request.sensor or request.camera or request.optics) is not None


def _robot_camera(request: RenderRequest) -> str | None:
    """Name of the robot's camera that takes the image, or whose place another one has."""
    return None if _has_own_camera(request) else request.camera_name


def _camera(request: RenderRequest, vehicle: Vehicle | None) -> OmniCamera:
    if vehicle is not None and not _has_own_camera(request):
        camera = vehicle.camera(request.camera_name).sensor
    else:
        camera = read_camera(
            request.sensor, request.camera, request.camera_name, request.mirrored, request.optics
        )
    if request.faces is not None:
        check_central(camera.model, "--faces")
    if isinstance(camera.model, NonCentralCamera) and (request.also or request.boxes_3d):
        require_extra("rays", "ground truth of an optical system")
    degradation = read_preset(request.preset)
    if degradation is not None:
        camera = camera.with_degradation(degradation)
    if request.size_px is not None:
        camera = camera.resized(request.size_px)
    if request.quality is not None:
        camera = camera.with_quality(request.quality)
    if request.polygons is not None:
        camera = camera.with_polygons(parse_polygons(request.polygons))
    return camera


def _other_viewpoints(
    request: RenderRequest, current: Viewpoint, channels: Collection[str]
) -> dict[str, Viewpoint]:
    """Viewpoints of the "next" and the "previous" frame, where a channel needs them."""
    others = {CHANNELS[name].other for name in channels}
    advances_m = {"next": DEFAULT_ADVANCE_M, "previous": -DEFAULT_ADVANCE_M}
    return {
        other: _other_viewpoint(current, advance_m, *_other_options(request, other).values())
        for other, advance_m in advances_m.items()
        if other in others
    }


def _other_options(request: RenderRequest, other: str) -> dict[str, Any]:
    """Viewpoint and heading of the next or the previous frame, None: not given, by option."""
    if other == "next":
        return {"--next": request.next_at, "--next-yaw": request.next_yaw_deg}
    return {"--previous": request.previous_at, "--previous-yaw": request.previous_yaw_deg}


def _other_viewpoint(
    current: Viewpoint,
    advance_m: float,
    at: tuple[float, float, float] | None,
    given_yaw_deg: float | None,
) -> Viewpoint:
    """Viewpoint of another frame: as given, or a little ahead."""
    yaw_deg = current.yaw_deg if given_yaw_deg is None else given_yaw_deg
    turned = dataclasses.replace(current, yaw_deg=yaw_deg)
    if at is not None:
        return dataclasses.replace(turned, position_m=at)
    if given_yaw_deg is not None:
        return turned
    x, y, z = (current.position_m + advance_m * current.pose[:3, 0]).tolist()
    return dataclasses.replace(current, position_m=(x, y, z))


def _twist(request: RenderRequest, camera: OmniCamera) -> Twist:
    turn_rate_radps = math.radians(request.turn_rate_degps)
    shutter = camera.degradation.shutter
    if (request.speed_mps or turn_rate_radps) and not (shutter and shutter.duration_s):
        print_note("this camera's shutter takes no time: no motion shows")
    return Twist((request.speed_mps, 0.0, 0.0), (0.0, 0.0, turn_rate_radps))


def _calibration(sensor: OmniCamera, world_from_base: NDArray[np.float64]) -> Calibration:
    """Calibration of the camera with its pose on the vehicle, and the vehicle's in the world."""
    from omnisim.cameras.calibration import CalibratedCamera, Calibration, NamedPose
    from omnisim.cameras.calibration.calibrated_camera import OPTICS

    poses = (
        NamedPose("base", "camera", sensor.base_from_optical),
        NamedPose("world", "base", world_from_base),
    )
    if not isinstance(sensor.model, NonCentralCamera):
        return Calibration((CalibratedCamera("camera", sensor.model, poses),))
    from omnisim.cameras.optics.central_fit import fit_central
    from omnisim.cameras.optics.system import OpticalSystem

    assert isinstance(sensor.model, OpticalSystem)
    camera = fit_central(sensor.model).cameras[0]
    optics = dataclasses.replace(poses[0], source=OPTICS)
    return Calibration((dataclasses.replace(camera, poses=(*camera.poses, optics, poses[1])),))


def _flow_summary(request: RenderRequest, other: str, viewpoint: Viewpoint) -> str:
    flow, side = ("flow", "ahead") if other == "next" else ("backward flow", "behind")
    is_default = all(value is None for value in _other_options(request, other).values())
    reason = f", {DEFAULT_ADVANCE_M:g} m {side} as no --{other} says" if is_default else ""
    return f"; {flow} to {viewpoint}{reason}"


def _note_coarse_ranges(image: Path, ranges_m: NDArray[np.float32]) -> None:
    steps_per_m = range_steps_per_m(ranges_m)
    if steps_per_m < FINEST_RANGE_STEPS_PER_M:
        print_note(
            f"{sidecar_path(image, 'range.png')}: {1000 / steps_per_m:g} mm a step, not 1, to "
            "hold what is beyond 65.534 m"
        )


def _write_faces(folder: Path, faces: dict[str, NDArray[np.uint8]]) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{folder}: this folder cannot be made: {reason.strerror}") from None
    for name, pixels in faces.items():
        write_image(folder / f"{name}.png", pixels)
    write_image(folder / "unfolded.png", unfolded_cube(faces))
    out.print(f"{folder}: {', '.join(faces)}, unfolded", markup=False)
