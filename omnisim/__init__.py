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
Cameras in a simulator that you run, such as MuJoCo: `omnisim.follow`.
The camera in a browser, or in a notebook's cell: `live`.
Errors: `OmnisimError`; notices about files are warnings, `NoticeWarning`.

Units are meters and radians unless a name says otherwise (`_deg`, `_px`). `help(omnisim.Stage)`
documents a name, `omnisim --help` the command line. Tutorials, guides, reference and explanation
are in `docs/` of the source code.
"""

from omnisim.core.lazy_names import lazy_names

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
    "Calibration": "cameras.calibration",
    "calibration_of": "cameras.calibration",
    "load_calibration": "cameras.calibration",
    "save_calibration": "cameras.calibration",
    "Degradation": "rendering.camera.degradations",
    "Twist": "rendering.twist",
    "NoticeWarning": "core.errors",
    "OmnisimError": "core.errors",
    "Frame": "ground_truth.frame",
    "pose": "core.poses",
    "LaserRenderer": "sensors",
    "LaserScanner": "sensors",
    "Scan": "sensors",
    "Scene": "scene",
    "load_scene": "scene",
    "OmniCamera": "rendering",
    "Renderer": "rendering",
    "Stage": "rendering",
    "open_sensor": "rendering",
    "Vehicle": "robots.vehicle",
    "Motion": "core.world",
    "WorldState": "core.world",
    "__version__": "core.version",
    "live": "apps.live.notebook",
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


__getattr__ = lazy_names(__name__, _MODULES)
