"""Options of a rig along a trajectory."""

from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import CAMERA, TRAJECTORY

TrajectoryOption = Annotated[
    Path | None,
    typer.Option(
        "--trajectory",
        metavar="FILE",
        help="Poses to render at, instead of one viewpoint: TUM, KITTI, EuRoC, .csv, or "
        "nerfstudio's transforms.json, also with its camera. --at, --yaw, --pitch and --roll place "
        "the file's origin in the scene, at 0 without them.",
        rich_help_panel=TRAJECTORY,
    ),
]
TrajectoryFrameOption = Annotated[
    str | None,
    typer.Option(
        "--trajectory-frame",
        metavar="body|camera|NAME",
        help="Frame that the poses of --trajectory are of: the rig's body, its first camera, or "
        "the camera of a name.",
        show_default="by the file's format, with a note",
        rich_help_panel=TRAJECTORY,
    ),
]
TrajectoryRateOption = Annotated[
    float | None,
    typer.Option(
        "--rate",
        metavar="HZ",
        help="Poses per second of a trajectory without times.",
        show_default="1, with a note",
        rich_help_panel=TRAJECTORY,
    ),
]
RigCameraOption = Annotated[
    str | None,
    typer.Option(
        "--camera-name",
        metavar="NAME|all",
        help="Camera of the calibration file.",
        show_default="the first, or all with --trajectory",
        rich_help_panel=CAMERA,
    ),
]
ImageOrRunOption = Annotated[
    Path,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE|DIR",
        help="Image: .png .jpg .tif (sRGB) or .exr (linear); with --trajectory the folder of the "
        "run, which resumes.",
    ),
]
