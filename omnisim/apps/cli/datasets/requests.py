"""Requests of the commands that generate and read data sets."""

from pathlib import Path
from typing import Annotated, ClassVar

from omnisim.apps.cli.completion import names_of
from omnisim.apps.cli.option_groups import DeviceOptions, EngineOptions
from omnisim.apps.cli.options import Argument, Option, command, options

_LAYOUTS = names_of("datasets.export.export_formats.LAYOUTS")
DataSet = Annotated[Path, Argument(metavar="DIR", help="Folder of a complete data set.")]


@options
class TrialOptions:
    """Trials before the data set is generated."""

    panel: ClassVar[str] = "Before generating"

    check: bool = False
    """Only check the plan and its files."""
    preview: Annotated[int | None, Option(ge=1, le=400)] = None
    """Only render the first samples onto one sheet."""
    map: bool = False
    """Only plot the free floors and the positions of the first 400 samples, from above."""
    estimate: bool = False
    """Only render a few samples to estimate the total time and size."""


@command("generate", "datasets.generate.run")
class GenerateRequest(EngineOptions):
    """Generate a data set from a plan: deterministic shards, reproducible by index.

    omnisim generate plan.toml --preview 16 -o sheet.png
    omnisim generate plan.toml --workers 4 -o dataset
    """

    plan: Annotated[Path, Argument(metavar="PLAN")]
    """Plan of the data set: .toml."""
    output: Annotated[Path | None, Option(metavar="DIR")] = None
    """Folder of the data set; finished shards in it are kept. With --preview or --map: an image."""
    shards: Annotated[str | None, Option(metavar="FROM:TO")] = None
    """Range of shards to generate, the last excluded; or a single number. Default: all of the
    plan."""
    workers: Annotated[int, Option(ge=1, le=1024)] = 1
    """Number of rendering processes."""
    trial: TrialOptions
    gpu: DeviceOptions


@command("dataset info", "datasets.dataset.info")
class DatasetInfoRequest:
    """Summarize a data set: samples, scenes, cameras, channels, size.

    omnisim dataset info dataset
    omnisim dataset info dataset --json
    """

    folder: DataSet
    json: bool = False
    """Print the manifest as JSON."""


@command("dataset check", "datasets.dataset.check")
class DatasetCheckRequest:
    """Compare the hash of each shard with the manifest.

    omnisim dataset check dataset
    omnisim dataset check data/train
    """

    folder: DataSet


@options
class CocoOptions:
    """Boxes of objects."""

    panel: ClassVar[str] = "With --to coco or yolo"

    min_area_px: Annotated[int | None, Option(flags=("--min-area-px",), ge=1)] = None
    """Minimum number of visible pixels of an annotated object. Default: 1."""
    min_visible: Annotated[float | None, Option(metavar="SHARE", ge=0, le=1, example="0.5")] = None
    """Minimum visible share, 0 to 1, of the pixels that an annotated object would cover if nothing
    hid it; requires a data set whose plan has min_visible. Default: any."""
    polygons: bool = False
    """Write masks as polygons instead of run lengths; with --to coco."""
    split: Annotated[str | None, Option(metavar="NAME=SHARE,…")] = None
    """Splits, with one annotation file or list of images each, such as train=0.8,val=0.2. Default:
    all in one."""


@command("dataset convert", "datasets.dataset.convert")
class DatasetConvertRequest:
    """Convert a data set to the layout of COCO, YOLO, KITTI-360, nerfstudio or COLMAP.

    omnisim dataset convert dataset --split train=0.8,val=0.2 -o coco
    omnisim dataset convert dataset --to colmap -o colmap
    """

    folder: DataSet
    output: Annotated[Path, Option(metavar="DIR")]
    """New folder for the converted data set."""
    to: Annotated[str, Option(metavar="FORMAT", names=_LAYOUTS)] = "coco"
    """Layout: coco, with boxes and masks; yolo, with boxes; or kitti360, nerfstudio, colmap or
    colmap-binary, with poses and calibrations."""
    coco: CocoOptions


@command("dataset view", "datasets.dataset.view")
class DatasetViewRequest:
    """Write a sheet of samples with their channels.

    omnisim dataset view dataset -o sheet.png
    omnisim dataset view dataset --first 100 --count 4 -o sheet.png
    """

    folder: DataSet
    output: Path
    """Sheet to write: .png or .jpg."""
    first: Annotated[int, Option(ge=0)] = 0
    """Index of the first sample."""
    count: Annotated[int, Option(ge=1, le=400)] = 16
    """Number of samples."""
