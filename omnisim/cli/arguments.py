"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

SceneArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="Scene file (.glb .gltf .obj .ply .stl .dae, or a scene's .toml), "
        "or name of a built-in scene.",
    ),
]
PictureOption = Annotated[
    Path,
    typer.Option(
        "-o", "--output", readable=False, help="Picture: .png .jpg .tif (sRGB) or .exr (linear)."
    ),
]
AtOption = Annotated[
    tuple[float, float, float] | None,
    typer.Option(
        "--at",
        metavar="X Y Z",
        help="Viewpoint in metres, z up; by default the scene's start.",
    ),
]
YawOption = Annotated[
    float | None,
    typer.Option("--yaw", metavar="DEG", help="Heading, counter-clockwise from +x. [dim]0[/]"),
]
PolygonsOption = Annotated[
    str | None,
    typer.Option(
        "-n",
        "--polygons",
        metavar="POLYGONS|exact",
        help="Polygons of the mirror's mesh, or exact. [dim]1024, or the sensor file's[/]",
    ),
]
SizeOption = Annotated[
    int | None, typer.Option("--size", metavar="PX", help="Pixels of the shorter side.")
]
QualityOption = Annotated[
    str | None,
    typer.Option(
        "--quality",
        metavar="fast|default|fine",
        help="Samples per pixel and resolution of the virtual cameras. [dim]the sensor file's[/]",
    ),
]
UnlitOption = Annotated[bool, typer.Option("--unlit", help="Plain base colours, no lights.")]
UpOption = Annotated[
    str | None,
    typer.Option("--up", metavar="x|y|z", help="Up axis of the scene file."),
]
PresetOption = Annotated[
    str | None,
    typer.Option(
        "--preset",
        metavar="NAME|FILE",
        help="Degradations of the camera: ideal, dragonfly2, webcam, bad-day, or a .toml "
        "file. [dim]the sensor file's[/]",
    ),
]
DeviceOption = Annotated[
    int | None,
    typer.Option("--device", min=0, help="Number of the GPU, as `omnisim info` lists them."),
]
AlsoOption = Annotated[
    str | None,
    typer.Option(
        "--also",
        metavar="CHANNELS",
        help="Ground-truth channels, comma-separated, or all: range z position normals "
        "normals_camera albedo semantic instance flow occluded valid.",
    ),
]
LabelsOption = Annotated[
    Path | None,
    typer.Option("--labels", metavar="FILE", help="Label file instead of the scene's own: .toml."),
]
RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")]
RunSceneOption = Annotated[
    str | None, typer.Option("--scene", help="The run's scene, if it has moved.")
]
RunCameraOption = Annotated[
    str | None, typer.Option("--camera", help="Name of a camera. [dim]the first[/]")
]
CameraNameOption = Annotated[
    str | None,
    typer.Option("--camera-name", metavar="NAME", help="Camera of the calibration file."),
]
MirroredOption = Annotated[
    bool | None,
    typer.Option(
        "--mirrored/--not-mirrored",
        help="The file's camera looks into a mirror. [dim]as in the file's metadata, or not[/]",
        show_default=False,
    ),
]
