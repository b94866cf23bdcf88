"""`omnisim unwarp`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import out, print_note
from omnisim.apps.cli.images.requests import ImageCameraOptions, UnwarpRequest
from omnisim.apps.cli.inputs import parse_channel_format, read_camera
from omnisim.apps.cli.options import refuse_given
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OpticsError
from omnisim.core.files.atomic_file import check_distinct, check_target
from omnisim.core.files.image_files import is_float_format, write_image
from omnisim.core.short_repr import number_text
from omnisim.core.srgb import linear_from_srgb8, srgb8_from_linear
from omnisim.core.version import __version__
from omnisim.ground_truth import Labels, channel_files, check_channels, parse_channels
from omnisim.perception import unwarping
from omnisim.perception.unwarping import ChannelUnwarping, Unwarping, View
from omnisim.rendering.camera.captured_image import CapturedImage, read_captured_image

DEFAULT_FIELD_OF_VIEW_DEG = 90.0
_INHERITED = (
    "scene", "lit", "exposure", "world_from_base", "next_world_from_base",
    "previous_world_from_base",
)  # fmt: skip
MAX_SIDE_PX = 32768
MAX_PIXELS = 1 << 26  # an EXR file of 1 GB


def run(request: UnwarpRequest) -> None:
    """Unwarp one image, write it and print a summary with the share of masked pixels."""
    for kind, names in (
        ("perspective", ("pitch_deg", "field_of_view_deg")),
        ("cylinder", ("elevation_deg",)),
        ("birdseye", ("height_m", "extent_m")),
    ):
        if request.kind != kind:
            reason = f"requires --to {kind}, got --to {request.kind}"
            refuse_given(request, reason, *names, error=OpticsError)
    channel_format = parse_channel_format(request.channel_format, request.also or "")
    is_float = is_float_format(request.output)
    check_target(request.output)
    check_distinct({"the view": request.output}, {"the source image": request.source})
    if request.also is not None:
        files = (
            channel_files.sidecar_path(path, "channels.json")
            for path in (request.output, request.source)
        )
        check_distinct({"the view's channels": next(files)}, {"the image's channels": next(files)})
    camera = None if request.camera == ImageCameraOptions() else read_camera(request.camera)
    distance_m = math.inf if request.right_at is None else request.right_at
    taken, caveat = read_captured_image(request.source, camera).assuming_viewpoint(distance_m)
    view = _view(request, taken)
    width, height = view.camera.width_px, view.camera.height_px
    if max(width, height) > MAX_SIDE_PX or width * height > MAX_PIXELS:
        raise OpticsError(
            f"--size: expected at most {MAX_SIDE_PX} per side and {MAX_PIXELS} pixels, got a "
            f"{request.kind} of {width} × {height} px"
        )
    camera_from_view = taken.base_from_optical.T @ view.base_from_view
    try:
        unwarp = Unwarping(taken.camera, view.camera, camera_from_view, taken.covered)
    except OpticsError as reason:
        raise OpticsError(f"{request.source}: {reason}: choose another direction") from None
    # metadata of the view: its own camera and pose, and the image's scene
    base_from_optical = np.eye(4)
    base_from_optical[:3, :3] = view.base_from_view
    inherited = {key: value for key, value in taken.metadata.items() if key in _INHERITED}
    if taken.world_from_optical is not None and taken.world_from_base is not None:
        camera_from_base = np.linalg.inv(taken.world_from_base) @ taken.world_from_optical
        base_from_optical[:3, 3] = camera_from_base[:3, 3]
        world_from_optical = taken.world_from_base @ base_from_optical
        inherited["world_from_optical"] = world_from_optical.tolist()
    metadata = {"omnisim": __version__, "camera": view.camera.parameters(), **inherited}
    channels, labels, has_ray = _channels(request, taken, view, camera_from_view, metadata)
    colors = taken.pixels
    if is_float:
        is_srgb = colors.dtype == np.uint8
        colors = linear_from_srgb8(colors) if is_srgb else colors.astype(np.float32, copy=False)
    colors = unwarp(colors)
    pixels = np.empty((*unwarp.valid.shape, 4), dtype=np.float32 if is_float else np.uint8)
    for row, color_row in zip(pixels, colors, strict=True):  # row by row, to save memory
        fits = is_float or colors.dtype == np.uint8
        row[:, :3] = color_row if fits else srgb8_from_linear(color_row)
    pixels[..., 3] = np.where(unwarp.valid, 1.0 if is_float else 255, 0)
    if channels and is_float and channel_format is not channel_files.ChannelFormat.NPY:
        channel_files.write_exr(request.output, channels, labels, metadata, pixels)
    else:
        write_image(request.output, pixels, metadata)
    if channels and not (is_float and channel_format is channel_files.ChannelFormat.AUTO):
        channel_files.write_sidecars(
            request.output, channels, labels, metadata, has_ray, channel_format
        )
    channel_files.write_boxes(request.output, channels, labels)
    masked, total = int(np.count_nonzero(~unwarp.valid)), unwarp.valid.size
    summary = f"{request.output}: {request.kind}, {width} × {height} px"
    if masked:
        share = f"{100.0 * masked / total:.2g} %"
        summary += f"; {masked} pixels ({share}) outside the camera's view are masked"
    out.print(summary)
    if channels:
        out.print(f"{request.output}: also {', '.join(channels)}")
    if caveat is not None:
        print_note(f"{request.source}: {caveat}")


def _channels(
    request: UnwarpRequest,
    taken: CapturedImage,
    view: View,
    camera_from_view: Floats,
    metadata: dict[str, Any],
) -> tuple[dict[str, NDArray[Any]], Labels | None, Bools]:
    """Requested channels of the view, their labels, and the mask of pixels with a ray."""
    if request.also is None:
        return {}, None, np.zeros(0, dtype=np.bool_)
    stored = channel_files.StoredChannels(request.source, taken.metadata)
    wants_all = "all" in request.also.lower().split(",")
    names = stored.names if wants_all else parse_channels(request.also)
    sources = {"position"} if "z" in names and "position" in stored.names else set()
    channels = stored.read(check_channels({*names, *sources}))
    unwarp = ChannelUnwarping(taken.camera, view.camera, camera_from_view, taken.covered)
    unwarped = unwarp(channels, metadata.get("world_from_optical"))
    return {name: unwarped[name] for name in names}, stored.labels, unwarp.valid


def _view(request: UnwarpRequest, taken: CapturedImage) -> View:
    side = min(taken.camera.width_px, taken.camera.height_px)
    width, height = request.size_px or (side, side)
    if not 1 <= min(width, height) <= max(width, height) <= MAX_SIDE_PX:
        raise OpticsError(
            f"--size: expected 1 to {MAX_SIDE_PX} pixels per side, got {width} × {height}"
        )
    yaw = math.radians(request.yaw_deg)
    if request.kind == "perspective":
        given_deg = request.field_of_view_deg
        field_deg = DEFAULT_FIELD_OF_VIEW_DEG if given_deg is None else given_deg
        pitch = math.radians(request.pitch_deg or 0.0)
        return unwarping.perspective_view(width, height, math.radians(field_deg), yaw, pitch)
    if request.kind == "cylinder":
        # the width equals the circumference of the largest circle in the image
        width = request.size_px[0] if request.size_px else max(8, round(math.pi * side))
        highest_deg = unwarping.highest_elevation_deg(taken.camera, taken.base_from_optical)
        low, high = request.elevation_deg or (-45.0, highest_deg)
        view = unwarping.cylinder_view(width, math.radians(low), math.radians(high), yaw)
        if request.size_px and view.camera.height_px != height:
            raise OpticsError(
                f"--size: expected {width} × {view.camera.height_px} for a cylinder from "
                f"{number_text(low)}° to {number_text(high)}°, got {width} × {height}: "
                "change the size or --elevation"
            )
        return view
    height_m = request.height_m
    if height_m is None:
        remedy = "pass --height METERS"
        if taken.height_m is None:
            missing = "expected the camera's height in the metadata"
            raise OpticsError(f"{request.source}: {missing}: {remedy}")
        if taken.height_m <= 0.0:
            got = f"expected a camera above the ground, got z = {number_text(taken.height_m)} m"
            raise OpticsError(f"{request.source}: {got}: {remedy}")
        height_m = taken.height_m
    if width != height:
        got = f"expected a square for a bird's eye view, got {width} × {height}"
        raise OpticsError(f"--size: {got}")
    extent_m = 4.0 * height_m if request.extent_m is None else request.extent_m
    return unwarping.birdseye_view(width, extent_m, height_m, yaw)
