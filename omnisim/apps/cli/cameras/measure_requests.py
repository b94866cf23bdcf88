"""Requests of `omnisim measure`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from omnisim.apps.cli.options import Argument, Option


@dataclass(frozen=True, kw_only=True)
class MeasureNoiseRequest:
    """Parameters of `omnisim measure noise`."""

    dark: Annotated[Path, Argument(metavar="DARK")]
    """Folder of dark frames, with one folder per exposure, such as 2.5ms."""
    flat: Annotated[Path, Argument(metavar="FLAT")]
    """Folder of evenly lit frames, likewise, of three exposures or more."""
    output: Path
    """Sensor file to write: .toml; a report and the fixed pattern are written beside it."""
    sensor: Annotated[Path | None, Option(default="none")] = None
    """Sensor file to add the noise to."""
    bit_depth: Annotated[int | None, Option(metavar="BITS", default="those that values use")] = None
    """Bits of the converter."""
    bayer: bool = False
    """The frames are a Bayer mosaic."""


@dataclass(frozen=True, kw_only=True)
class MeasureSharpnessRequest:
    """Parameters of `omnisim measure sharpness`."""

    images: Annotated[Path, Argument(metavar="IMAGES")]
    """Folder of images of slanted edges, linear: PNG, TIFF, PGM or EXR; or one image."""
    output: Path
    """Sensor file to write: .toml; a report is written beside it."""
    sensor: Annotated[Path | None, Option(default="none")] = None
    """Sensor file of the camera to add point spread and lateral color to; its principal point is
    the center of the field."""
    corners: Annotated[Path | None, Option(default="all straight edges are measured")] = None
    """Corners of a board of squares in each image, as for optics calibrate: .csv."""
    response: Annotated[str | None, Option(metavar="srgb|GAMMA", default="linear, checked")] = None
    """Encoding of the images, such as srgb or 2.2; 1: linear, unchecked."""
