"""Parameters of the commands that make and read data sets."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import DeviceOption
from omnisim.apps.cli.completion import ENGINES, LAYOUTS, one_of

BEFORE, OF_COCO = "Before it is made", "With --to coco"  # panels of help pages

DatasetArgument = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder of a data set that is whole.")
]


@dataclass(frozen=True)
class GenerateRequest:
    """Parameters of `omnisim generate`."""

    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="Plan of the data set: a .toml.")]
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Folder of the data set; shards that are there stay. With --preview and --map: a "
            "image.",
        ),
    ] = None
    shards: Annotated[
        str | None,
        typer.Option(
            "--shards",
            metavar="FROM:TO",
            help="Numbers of the shards to make, the last excluded; or a single number.",
            show_default="all of the plan",
        ),
    ] = None
    workers: Annotated[
        int,
        typer.Option("--workers", metavar="N", min=1, max=1024, help="Processes that render."),
    ] = 1
    device: DeviceOption = None
    engine: Annotated[
        str,
        typer.Option(
            "--engine",
            metavar="NAME",
            autocompletion=one_of(*ENGINES),
            help="Engine that spreads the shards: local, or ray.",
        ),
    ] = "local"
    address: Annotated[
        str | None,
        typer.Option(
            "--address",
            metavar="ADDRESS",
            help="Address of the Ray cluster.",
            show_default="a cluster on this machine",
        ),
    ] = None
    check: Annotated[
        bool,
        typer.Option("--check", help="Only check the plan and its files.", rich_help_panel=BEFORE),
    ] = False
    preview: Annotated[
        int | None,
        typer.Option(
            "--preview",
            metavar="N",
            min=1,
            max=400,
            help="Only render the first samples, onto one sheet.",
            rich_help_panel=BEFORE,
        ),
    ] = None
    map: Annotated[
        bool,
        typer.Option(
            "--map",
            help="Only plot the free floors and the places of the first 400 samples, from above.",
            rich_help_panel=BEFORE,
        ),
    ] = False
    estimate: Annotated[
        bool,
        typer.Option(
            "--estimate",
            help="Only render some samples, and say how long all take and how large they are.",
            rich_help_panel=BEFORE,
        ),
    ] = False


@dataclass(frozen=True)
class DatasetInfoRequest:
    """Parameters of `omnisim dataset info`."""

    folder: DatasetArgument
    json: Annotated[bool, typer.Option("--json", help="Print the manifest as JSON.")] = False


@dataclass(frozen=True)
class DatasetCheckRequest:
    """Parameters of `omnisim dataset check`."""

    folder: DatasetArgument


@dataclass(frozen=True)
class DatasetConvertRequest:
    """Parameters of `omnisim dataset convert`."""

    folder: DatasetArgument
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="New folder to write.")
    ]
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="FORMAT",
            autocompletion=one_of(*LAYOUTS),
            help="Layout: coco, with boxes and masks; kitti360, nerfstudio, colmap or "
            "colmap-binary, with poses and calibrations.",
        ),
    ] = "coco"
    min_area_px: Annotated[
        int | None,
        typer.Option(
            "--min-area-px",
            metavar="PX",
            min=1,
            help="Visible pixels of an object from which on it is annotated.",
            show_default="1",
            rich_help_panel=OF_COCO,
        ),
    ] = None
    min_visible: Annotated[
        float | None,
        typer.Option(
            "--min-visible",
            metavar="SHARE",
            help="Share of the pixels that an object would cover alone, 0 to 1, from which on it "
            "is annotated; of a data set whose plan has min_visible.",
            show_default="any",
            rich_help_panel=OF_COCO,
        ),
    ] = None
    polygons: Annotated[
        bool,
        typer.Option(
            "--polygons",
            help="Masks as polygons, in place of run lengths.",
            rich_help_panel=OF_COCO,
        ),
    ] = False
    split: Annotated[
        str | None,
        typer.Option(
            "--split",
            metavar="NAME=SHARE,…",
            help="Annotations in a file each, such as train=0.8,val=0.2.",
            show_default="all in one",
            rich_help_panel=OF_COCO,
        ),
    ] = None


@dataclass(frozen=True)
class DatasetViewRequest:
    """Parameters of `omnisim dataset view`."""

    folder: DatasetArgument
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="Sheet to write: .png or .jpg."),
    ]
    first: Annotated[
        int, typer.Option("--first", metavar="N", min=0, help="Number of the first sample.")
    ] = 0
    count: Annotated[
        int, typer.Option("--count", metavar="N", min=1, max=400, help="Number of samples.")
    ] = 16
