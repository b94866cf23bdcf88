"""Parameters of the commands of `omnisim optics`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

SystemArgument = Annotated[
    Path, typer.Argument(metavar="SYSTEM", help="Optics file: .toml.", show_default=False)
]

PROFILE_POINTS = 501
DESIGN_SIZE_PX = 720


@dataclass(frozen=True)
class OpticsCheckRequest:
    """Parameters of `omnisim optics check`."""

    system: SystemArgument
    at_distance: Annotated[
        list[float] | None,
        typer.Option(
            "--at-distance",
            metavar="METERS",
            help="Distances of points from the viewpoint: --at-distance 0.3 1 5.",
            show_default="0.3, 1 and 5",
        ),
    ] = None
    more_distances: Annotated[
        list[float] | None,
        typer.Argument(metavar="METERS", help="More distances.", show_default=False),
    ] = None


@dataclass(frozen=True)
class OpticsPlotRequest:
    """Parameters of `omnisim optics plot`."""

    system: SystemArgument
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Plot: .png .pdf .svg.")
    ]


@dataclass(frozen=True)
class OpticsRaysRequest:
    """Parameters of `omnisim optics rays`."""

    system: SystemArgument
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="Ray table: .exr, 32-bit floats."),
    ]
    color: Annotated[
        str | None,
        typer.Option(
            "--color",
            metavar="R|G|B",
            help="Wavelength of a color.",
            show_default="that of the file",
        ),
    ] = None


@dataclass(frozen=True)
class OpticsDesignRequest:
    """Parameters of `omnisim optics design`."""

    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Profile: .csv, r_m,z_m; or .toml: the whole system, its profile beside it.",
        ),
    ]
    distance_m: Annotated[
        float,
        typer.Option("--distance", metavar="METERS", help="From the pinhole to the mirror's tip."),
    ]
    half_angle_deg: Annotated[
        float,
        typer.Option(
            "--half-angle", metavar="DEGREES", help="From the axis to the rim, at the pinhole."
        ),
    ]
    equi_angular_deg: Annotated[
        float | None,
        typer.Option(
            "--equi-angular",
            metavar="DEGREES",
            help="Constant angular resolution, up to this angle from straight down at the rim.",
        ),
    ] = None
    equi_ground_m: Annotated[
        float | None,
        typer.Option(
            "--equi-ground",
            metavar="METERS",
            help="Constant resolution on the ground, up to this distance at the rim.",
        ),
    ] = None
    height_m: Annotated[
        float | None,
        typer.Option(
            "--height", metavar="METERS", help="Pinhole above the ground, for --equi-ground."
        ),
    ] = None
    size_px: Annotated[
        int | None,
        typer.Option(
            "--size",
            metavar="PX",
            min=2,
            max=16384,
            help="Side of the square image of a .toml, which the rim fills.",
            show_default=str(DESIGN_SIZE_PX),
        ),
    ] = None


@dataclass(frozen=True)
class OpticsProfileRequest:
    """Parameters of `omnisim optics profile`."""

    system: SystemArgument
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Profile: .csv, r_m,z_m.")
    ]
    surface: Annotated[
        int, typer.Option("--surface", metavar="NUMBER", help="Number of the surface, from 0.")
    ] = 0
    points: Annotated[
        int, typer.Option("--points", metavar="POINTS", min=4, max=100_000, help="Lines.")
    ] = PROFILE_POINTS


@dataclass(frozen=True)
class OpticsCalibrateRequest:
    """Parameters of `omnisim optics calibrate`."""

    system: SystemArgument
    corners: Annotated[
        Path,
        typer.Argument(
            metavar="CORNERS",
            help="Corners of a flat board: .csv, image,x_m,y_m,u_px,v_px.",
            show_default=False,
        ),
    ]
    free: Annotated[
        str,
        typer.Option(
            "--free",
            metavar="KEYS",
            help="Keys of SYSTEM to fit, comma-separated, as surfaces.0.decenter_m.",
        ),
    ]
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Optics file to write: .toml.")
    ]
