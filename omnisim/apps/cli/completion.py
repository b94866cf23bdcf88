"""Shell completion: names in place of what a command knows; paths are the shell's to complete.

A key press starts the command: nothing slow is imported here, not even NumPy. The lists that are
written out are tested against the modules that they stand for.
"""

import json
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path

import typer

from omnisim.core.package_files import SCENES, built_in

CHANNELS = (
    "range", "z", "position", "normals", "normals_camera", "albedo", "roughness", "metallic",
    "emissive", "semantic", "instance", "flow", "occluded", "flow_backward", "occluded_backward",
    "scene_flow", "scene_flow_camera", "valid",
)  # fmt: skip
CALIBRATION_FORMATS = (
    "omnisim", "kalibr", "kitti360", "opencv_omnidir", "opencv_fisheye", "opencv_pinhole", "ros",
    "basalt", "woodscape", "nerfstudio", "foxglove", "ocamcalib", "colmap", "gazebo",
)  # fmt: skip
EXPORT_FORMATS = (
    "ros2-mcap", "ros2-sqlite", "kitti", "kitti360", "tum", "euroc", "nerfstudio", "colmap",
    "colmap-binary", "tartanair",
)  # fmt: skip
CAMERA = "omnicamera"  # type of a sensor in a run's manifest
ENGINES = ("local", "ray")
LAYOUTS = ("coco", "kitti360", "nerfstudio", "colmap", "colmap-binary")  # of data sets
PRESETS = ("ideal", "dragonfly2", "webcam", "bad-day")
CHECKS = (
    "rings", "polygons", "viewpoint", "path-tracer", "second-rasterizer", "materials",
    "shadows", "baked", "rays", "quality", "markers", "omnidir", "boards", "orientation",
    "unwarping", "optics", "optics-path-tracer", "optics-triangles", "optics-calibration",
)  # fmt: skip
Completion = Callable[[str], list[str]]


def one_of(*words: str) -> Completion:
    """Completion of one of some words."""

    def complete(incomplete: str) -> list[str]:
        return _beginning(incomplete, words)

    return complete


def complete_scene(incomplete: str) -> list[str]:
    """Built-in scenes."""
    return _beginning(incomplete, built_in("scene.toml"))


def complete_robot(incomplete: str) -> list[str]:
    """Built-in robots."""
    return _beginning(incomplete, built_in("robot.toml"))


def complete_path(ctx: typer.Context, incomplete: str) -> list[str]:
    """Paths of the scene that is named before."""
    scene = _argument(ctx, "scene")
    file = scene if scene.suffix == ".toml" else scene / "scene.toml"
    if not file.is_file():
        file = SCENES / file
    try:
        paths = tomllib.loads(file.read_text(encoding="utf-8")).get("paths", [])
        return _beginning(incomplete, [path["name"] for path in paths])
    except (OSError, ValueError, KeyError, TypeError):
        return []


def complete_run_camera(ctx: typer.Context, incomplete: str) -> list[str]:
    """Cameras of the run that is named before."""
    manifest_file = _argument(ctx, "run", "source") / "manifest.json"
    try:
        manifest = json.loads(manifest_file.read_text(encoding="utf-8"))
        sensors = manifest["sensors"].items()
        return _beginning(incomplete, [name for name, one in sensors if one["type"] == CAMERA])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []


def complete_channels(incomplete: str) -> list[str]:
    """Channels between commas, each once."""
    done, comma, last = incomplete.rpartition(",")
    left = [name for name in (*CHANNELS, "all") if name not in done.split(",")]
    return [f"{done}{comma}{name}" for name in _beginning(last, left)]


def _argument(ctx: typer.Context, *names: str) -> Path:
    """Value of the argument of one of the names; before an unfinished option it is unparsed."""
    parsed = (ctx.params.get(name) for name in names)
    unparsed = (word for word in ctx.args if not word.startswith("-"))
    return Path(next((word for word in (*parsed, *unparsed) if word is not None), ""))


def _beginning(incomplete: str, words: Iterable[str]) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]
