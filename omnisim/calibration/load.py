"""Reading a calibration file: which format it is, and the cameras that it means."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.calibration.calibration import CalibratedCamera, Calibration
from omnisim.calibration.documents import read_text
from omnisim.calibration.file_frame import optical_camera
from omnisim.calibration.formats import FORMATS, Format, Said
from omnisim.calibration.formats.format import making
from omnisim.calibration.remarks import Remark, read_remarks
from omnisim.cameras import CentralCamera
from omnisim.errors import CalibrationError, did_you_mean

CENTRE_WITHIN = 0.5  # of the picture's size beside it: further away, one of both is wrong


def load_calibration(
    path: str | Path,
    format: str | None = None,
    camera: str | None = None,
    mirrored: bool | None = None,
) -> Calibration:
    """Read a calibration file.

    Args:
        path: the file.
        format: name of its format, one of `FORMATS`; by default what its content looks like.
        camera: name of the only camera to keep; by default all.
        mirrored: whether the cameras look into mirrors; by default what omnisim's remarks in the
            file say, and no where there are none.

    Raises:
        CalibrationError: naming file, key, value and what was wanted.
    """
    path = Path(path)
    text = read_text(path)
    form = format_of(text, str(path), format)
    with making(str(path)):
        said = form.read(text, str(path))
    remarks = read_remarks(text, form, str(path))
    names = [one.name for one in said]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise CalibrationError(f"{path}: two cameras are named {twice!r}: want different names")
    cameras = tuple(_camera(one, remarks.get(one.name), mirrored, str(path)) for one in said)
    if not cameras:
        raise CalibrationError(f"{path}: no camera in it")
    found = Calibration(cameras, form.name, str(path))
    return found if camera is None else found.only(camera)


def format_of(text: str, source: str, name: str | None = None) -> Format:
    """The format of a text: the one that is asked for, or that it looks like.

    Raises:
        CalibrationError: there is no format of that name, or the text looks like none.
    """
    alike = [form for form in FORMATS.values() if form.looks_like(text)]
    if name is None:
        if alike:
            unclear = alike[0].unclear(text, source)
            if unclear is not None:
                raise CalibrationError(f"{source}: {unclear}")
            return alike[0]
        if _is_sensor_file(text):
            raise CalibrationError(
                f"{source}: this looks like a sensor file: pass --sensor {source}"
            )
        raise CalibrationError(
            f"{source}: no calibration that omnisim knows: want one of " + ", ".join(FORMATS)
        )
    form = format_named(name)
    # opencv's three are told apart by what the user says
    foreign = [one for one in alike if _family(one) != _family(form)]
    if foreign and not form.looks_like(text) and len(foreign) == len(alike):
        raise CalibrationError(
            f"{source}: this looks like a {foreign[0].name} file ({foreign[0].title}): "
            f"pass --format {foreign[0].name}"
        )
    return form


def _is_sensor_file(text: str) -> bool:
    try:
        return bool({"lens", "mirror", "virtual_cameras"} & tomllib.loads(text).keys())
    except (tomllib.TOMLDecodeError, RecursionError):
        return False


def format_named(name: str) -> Format:
    """The format of a name.

    Raises:
        CalibrationError: there is none.
    """
    if name not in FORMATS:
        raise CalibrationError(f"format {name!r}: {did_you_mean(name.lower(), FORMATS)}")
    return FORMATS[name]


def _family(form: Format) -> str:
    return form.name.partition("_")[0]


def _camera(
    said: Said, remark: Remark | None, mirrored: bool | None, source: str
) -> CalibratedCamera:
    place = f"{source}: {said.name}"
    if mirrored is None:
        mirrored = remark.mirrored if remark else False
    limit = remark.theta_max_rad if remark else None
    with making(place):
        turned = remark.turned if remark else False
        camera = optical_camera(said.lens, mirrored, limit, turned)
        check_camera(camera, place)
    residual = remark.residual if remark else None
    return CalibratedCamera(
        said.name, camera, said.poses, residual, said.notes, said.lens.model_name
    )


def check_camera(camera: Any, place: str) -> None:
    """Refuse a camera whose picture shows nothing, or whose axis is far beside it.

    Raises:
        CalibrationError: with the centre, or with what the picture shows.
    """
    size = np.array([camera.width_px, camera.height_px], dtype=np.float64)
    centre = np.asarray(getattr(camera, "principal_point_px", 0.5 * (size - 1.0)))
    beside = np.maximum(-0.5 - centre, centre - (size - 0.5)) / size
    if not beside.max() <= CENTRE_WITHIN:
        u, v = centre
        raise CalibrationError(
            f"{place}: centre ({u:g}, {v:g}) of a picture of {size[0]:g} × {size[1]:g} px: "
            "want it in the picture, or near by: is one of both another picture's?"
        )
    if not _sees_something(camera, size, centre):
        raise CalibrationError(f"{place}: no pixel of this camera sees anything: want a lens")


def _sees_something(camera: CentralCamera, size: np.ndarray, centre: np.ndarray) -> bool:
    steps = np.linspace(0.0, 1.0, 33)
    grid = np.stack(np.meshgrid(*(steps * (side - 1.0) for side in size)), axis=-1)
    # not the centre itself, which broken numbers show, too, but the pixel there
    rays = camera.ray_from_pixel(np.concatenate((grid.reshape(-1, 2), np.rint(centre)[None])))
    return bool((rays.valid & np.isfinite(rays.directions).all(axis=-1)).any())


def renamed(
    cameras: tuple[CalibratedCamera, ...], names: list[str]
) -> tuple[CalibratedCamera, ...]:
    """The cameras by other names, in their poses too."""
    new = {camera.name: name for camera, name in zip(cameras, names, strict=True)}
    return tuple(
        dataclasses.replace(
            camera,
            name=new[camera.name],
            poses=tuple(
                dataclasses.replace(
                    pose,
                    target=new.get(pose.target, pose.target),
                    source=new.get(pose.source, pose.source),
                )
                for pose in camera.poses
            ),
        )
        for camera in cameras
    )
