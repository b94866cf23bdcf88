"""Requests of the commands that generate and read data sets."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from omnisim.apps.cli import completion
from omnisim.apps.cli.option_groups import DeviceOptions
from omnisim.apps.cli.options import Argument, Option

ENGINES = ("local", "ray")
DataSet = Annotated[Path, Argument(metavar="DIR")]


@dataclass(frozen=True, kw_only=True)
class TrialOptions:
    """Trials before the data set is generated."""

    panel: ClassVar[str] = "Before it is made"

    check: bool = False
    """Only check the plan and its files."""
    preview: Annotated[int | None, Option(min=1, max=400)] = None
    """Only render the first samples onto one sheet."""
    map: bool = False
    """Only plot the free floors and the positions of the first 400 samples, from above."""
    estimate: bool = False
    """Only render a few samples to estimate the total time and size."""


@dataclass(frozen=True, kw_only=True)
class GenerateRequest:
    """Parameters of `omnisim generate`."""

    plan: Annotated[Path, Argument(metavar="PLAN")]
    """Plan of the data set: .toml."""
    output: Annotated[Path | None, Option(metavar="DIR")] = None
    """Folder of the data set; finished shards in it are kept. With --preview or --map: an image."""
    shards: Annotated[str | None, Option(metavar="FROM:TO", default="all of the plan")] = None
    """Range of shards to generate, the last excluded; or a single number."""
    workers: Annotated[int, Option(min=1, max=1024)] = 1
    """Number of rendering processes."""
    engine: Annotated[str, Option(metavar="NAME", names=lambda: ENGINES)] = "local"
    """Engine that distributes the shards: local or ray."""
    address: Annotated[
        str | None, Option(metavar="ADDRESS", default="a cluster on this machine")
    ] = None
    """Address of the Ray cluster."""
    trial: TrialOptions
    gpu: DeviceOptions


@dataclass(frozen=True, kw_only=True)
class DatasetInfoRequest:
    """Parameters of `omnisim dataset info`."""

    folder: DataSet
    """Folder of a complete data set."""
    json: bool = False
    """Print the manifest as JSON."""


@dataclass(frozen=True, kw_only=True)
class DatasetCheckRequest:
    """Parameters of `omnisim dataset check`."""

    folder: DataSet
    """Folder of a complete data set."""


@dataclass(frozen=True, kw_only=True)
class CocoOptions:
    """Boxes of objects."""

    panel: ClassVar[str] = "With --to coco or yolo"

    min_area_px: Annotated[int | None, Option(flags=("--min-area-px",), min=1, default="1")] = None
    """Minimum number of visible pixels of an annotated object."""
    min_visible: Annotated[float | None, Option(metavar="SHARE", default="any")] = None
    """Minimum visible share, 0 to 1, of the pixels that an annotated object would cover alone;
    requires a data set whose plan has min_visible."""
    polygons: bool = False
    """Write masks as polygons instead of run lengths; with --to coco."""
    split: Annotated[str | None, Option(metavar="NAME=SHARE,…", default="all in one")] = None
    """Splits, with one annotation file or list of images each, such as train=0.8,val=0.2."""


@dataclass(frozen=True, kw_only=True)
class DatasetConvertRequest:
    """Parameters of `omnisim dataset convert`."""

    folder: DataSet
    """Folder of a complete data set."""
    output: Annotated[Path, Option(metavar="DIR")]
    """New folder for the converted data set."""
    to: Annotated[str, Option(metavar="FORMAT", names=completion.data_set_layouts)] = "coco"
    """Layout: coco, with boxes and masks; yolo, with boxes; or kitti360, nerfstudio, colmap or
    colmap-binary, with poses and calibrations."""
    coco: CocoOptions


@dataclass(frozen=True, kw_only=True)
class DatasetViewRequest:
    """Parameters of `omnisim dataset view`."""

    folder: DataSet
    """Folder of a complete data set."""
    output: Path
    """Sheet to write: .png or .jpg."""
    first: Annotated[int, Option(min=0)] = 0
    """Index of the first sample."""
    count: Annotated[int, Option(min=1, max=400)] = 16
    """Number of samples."""
