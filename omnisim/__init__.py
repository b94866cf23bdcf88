"""Simulator of omnidirectional cameras, accurate to a tenth of a pixel.

with omnisim.open_sensor("courtyard") as renderer:
    frame = renderer.render(renderer.camera.base_pose((0.0, 0.0, 1.0), yaw_deg=30.0))
    frame.save("frame.png")

Scenes and poses: `load_scene`, `Scene`, `pose`.
Cameras: `OmniCamera`, `Degradation`; models are in `omnisim.cameras`.
Calibration files: `load_calibration`, `save_calibration`, `calibration_of`, `Calibration`.
Images and ground truth: `open_sensor`, `Stage`, `Renderer`, `Frame`; channels are in
`omnisim.ground_truth.CHANNELS`.
Time and motion: `WorldState`, `Motion`, `Twist`.
Robots and laser scanners: `Vehicle`, `LaserScanner`, `LaserRenderer`, `Scan`.
Depth cameras: `DepthCamera` and `DepthRenderer` of `omnisim.sensors`.
Spinning lidars: `SpinningLidar`, `LidarRenderer` and `PointCloud` of `omnisim.sensors`.
Cameras inside a MuJoCo simulation: `omnisim.runs.mujoco_camera.Camera`.
The camera in a browser, or in a notebook's cell: `live`.
Errors: `OmnisimError`; notices about files are warnings, `NoticeWarning`.

Units are meters and radians unless a name says otherwise (`_deg`, `_px`). `help(omnisim.Stage)`
documents a name, `omnisim --help` the command line. Tutorials, guides, reference and explanation
are in `docs/` of the source code.
"""

TYPE_CHECKING = False  # as typing's, whose import takes a while: Ctrl-C is not handled yet

if TYPE_CHECKING:
    from omnisim.apps.live.notebook import live
    from omnisim.cameras.calibration.calibration import (
        Calibration,
        calibration_of,
        load_calibration,
        save_calibration,
    )
    from omnisim.core.errors import NoticeWarning, OmnisimError
    from omnisim.core.poses import pose
    from omnisim.core.version import __version__
    from omnisim.core.world import Motion, WorldState
    from omnisim.ground_truth.frame import Frame
    from omnisim.rendering.camera.degradations.degradation import Degradation
    from omnisim.rendering.camera.omnicamera import OmniCamera
    from omnisim.rendering.renderer import Renderer
    from omnisim.rendering.stage import Stage, open_sensor
    from omnisim.rendering.twist import Twist
    from omnisim.robots.vehicle import Vehicle
    from omnisim.scene.files.load import load_scene
    from omnisim.scene.model import Scene
    from omnisim.sensors.laser_scanner.laser_scanner import LaserRenderer, LaserScanner, Scan

# Modules of the names, imported at first use: `import omnisim` is fast, and `omnisim --help` needs
# no GPU library.
_MODULES = {
    "Calibration": "omnisim.cameras.calibration",
    "calibration_of": "omnisim.cameras.calibration",
    "load_calibration": "omnisim.cameras.calibration",
    "save_calibration": "omnisim.cameras.calibration",
    "Degradation": "omnisim.rendering.camera.degradations",
    "Twist": "omnisim.rendering.twist",
    "NoticeWarning": "omnisim.core.errors",
    "OmnisimError": "omnisim.core.errors",
    "Frame": "omnisim.ground_truth.frame",
    "pose": "omnisim.core.poses",
    "LaserRenderer": "omnisim.sensors",
    "LaserScanner": "omnisim.sensors",
    "Scan": "omnisim.sensors",
    "Scene": "omnisim.scene",
    "load_scene": "omnisim.scene",
    "OmniCamera": "omnisim.rendering",
    "Renderer": "omnisim.rendering",
    "Stage": "omnisim.rendering",
    "open_sensor": "omnisim.rendering",
    "Vehicle": "omnisim.robots.vehicle",
    "Motion": "omnisim.core.world",
    "WorldState": "omnisim.core.world",
    "__version__": "omnisim.core.version",
    "live": "omnisim.apps.live.notebook",
}
__all__ = [
    "Calibration",
    "Degradation",
    "Frame",
    "LaserRenderer",
    "LaserScanner",
    "Motion",
    "NoticeWarning",
    "OmniCamera",
    "OmnisimError",
    "Renderer",
    "Scan",
    "Scene",
    "Stage",
    "Twist",
    "Vehicle",
    "WorldState",
    "__version__",
    "calibration_of",
    "live",
    "load_calibration",
    "load_scene",
    "open_sensor",
    "pose",
    "save_calibration",
]


def __dir__() -> list[str]:
    return sorted(__all__)


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module 'omnisim' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_MODULES[name]), name)
