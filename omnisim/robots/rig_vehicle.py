"""Rigs as vehicles: cameras on a body that follows given poses, without a robot."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from omnisim.cameras.calibration.calibration import Rig
from omnisim.core.errors import CalibrationError
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.core.trajectories.odometry import OdometryErrors
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.sensor import Mount
from omnisim.robots.vehicle import Vehicle
from omnisim.sensors.sensor_names import folder_name


def rig_vehicle(name: str, rig: Rig, sensors: Sequence[OmniCamera] | None = None) -> Vehicle:
    """Build the vehicle of a rig: invisible, without wheels; its base is the rig's body.

    Args:
        name: name of the vehicle.
        rig: cameras and their poses on the body.
        sensors: sensor per camera; None: the rig's camera models with default settings.

    Raises:
        CalibrationError: two cameras have the same folder name.
    """
    if sensors is None:
        sensors = [OmniCamera(camera.model, polygons=None) for camera in rig.cameras]
    cameras = []
    for camera, sensor in zip(rig.cameras, sensors, strict=True):
        rig_from_optical = pose_from_rotation(camera.model.rig_from_optical, (0.0, 0.0, 0.0))
        base_from_rig = camera.body_from_camera @ inverse(rig_from_optical)
        mounted = dataclasses.replace(sensor, base_from_rig=base_from_rig)
        cameras.append(Mount(mounted, folder_name(camera.name), "omnicamera"))
    names = [camera.name for camera in cameras]
    for camera, folder in zip(rig.cameras, names, strict=True):
        if names.count(folder) > 1:
            raise CalibrationError(
                f"camera {camera.name!r}: expected a folder of its own, got {folder} for two"
            )
    return Vehicle(
        name=name,
        title=name,
        body=None,
        kinematics=None,
        odometry=OdometryErrors(),
        footprint=None,
        sensors=tuple(cameras),
    )
