"""Types of instruments, for mypy, which `make lint` runs: each sensor opens as its own."""

from pathlib import Path
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

from omnisim import OmniCamera, Scan, Stage, Vehicle, open_sensor
from omnisim.cameras import CentralCamera
from omnisim.rendering.renderer import RecordedFrame, Renderer
from omnisim.rendering.sensor import Mount
from omnisim.sensors import (
    DepthCamera,
    DepthRenderer,
    LaserRenderer,
    LaserScanner,
    LidarRenderer,
    PointCloud,
    RangeSensor,
    RangeSensorRenderer,
    SpinningLidar,
)


def opened(stage: Stage, model: CentralCamera, vehicle: Vehicle, pose: NDArray[np.float64]) -> None:
    """Instruments and readings of each sensor."""
    assert_type(stage.open(LaserScanner()), LaserRenderer)
    assert_type(stage.open(SpinningLidar(), pose, hidden={"mast"}), LidarRenderer)
    assert_type(stage.open(DepthCamera(), seed=1), DepthRenderer)
    assert_type(stage.open(RangeSensor()), RangeSensorRenderer)
    for camera in (None, OmniCamera(), model, "sensor.toml", Path("sensor.toml")):
        assert_type(stage.open(camera), Renderer)
    assert_type(stage.open(), Renderer)
    assert_type(stage.open(vehicle.camera()), Renderer)
    assert_type(stage.open(vehicle.scanner()), LaserRenderer)
    assert_type(stage.open(Mount(SpinningLidar(), "lidar")), LidarRenderer)
    assert_type(open_sensor("soccer", SpinningLidar()), LidarRenderer)
    assert_type(open_sensor("soccer"), Renderer)
    assert_type(stage.open(LaserScanner()).measure(pose), Scan)
    assert_type(stage.open(SpinningLidar()).measure(pose), PointCloud)
    assert_type(stage.open(DepthCamera()).measure(pose).depths_m, NDArray[np.float32])
    assert_type(stage.open().measure(pose), RecordedFrame)


def refused(stage: Stage) -> None:
    """Faults of each line, which mypy finds; it reports an unused comment where it does not."""
    stage.open(5)  # type: ignore[call-overload]
    stage.open(DepthCamera()).scan(np.eye(4))  # type: ignore[attr-defined]
