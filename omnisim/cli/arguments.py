"""Arguments and options that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SceneArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="A scene file (.glb .gltf .obj .ply .stl .dae, or a scene's .toml), "
        "or the name of a built-in scene.",
    ),
]
PictureOption = Annotated[
    Path,
    typer.Option("-o", "--output", help="Picture: .png .jpg .tif (sRGB) or .exr (linear)."),
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
        help="How finely pictures are captured. [dim]the sensor file's[/]",
    ),
]
UnlitOption = Annotated[bool, typer.Option("--unlit", help="Plain base colours, no lights.")]
UpOption = Annotated[
    str | None,
    typer.Option("--up", metavar="x|y|z", help="The scene file's axis that points up."),
]
PresetOption = Annotated[
    str | None,
    typer.Option(
        "--preset",
        metavar="NAME|FILE",
        help="What the camera lacks to be ideal: ideal, dragonfly2, webcam, bad-day, or a .toml "
        "file. [dim]the sensor file's[/]",
    ),
]
RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")]
DeviceOption = Annotated[
    int | None,
    typer.Option("--device", min=0, help="Number of the GPU, as `omnisim info` lists them."),
]
AlsoOption = Annotated[
    str | None,
    typer.Option(
        "--also",
        metavar="CHANNELS",
        help="Ground truth, names with commas, or all: range z position normals normals_camera "
        "albedo semantic instance flow occluded valid.",
    ),
]
LabelsOption = Annotated[
    Path | None,
    typer.Option("--labels", metavar="FILE", help="Classes, instead of the scene's own: a .toml."),
]
