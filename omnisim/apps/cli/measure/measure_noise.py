"""`omnisim measure noise`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from omnisim.apps.cli.console import out, track
from omnisim.apps.cli.measure.measured_files import (
    check_outputs,
    print_measured,
    round_to_sigma,
    sensor_tables,
    write_measured,
)
from omnisim.apps.cli.measure.requests import MeasureNoiseRequest
from omnisim.measurement.noise import (
    FrameStatistics,
    MeasuredNoise,
    find_frame_sets,
    measure_noise,
    read_statistics,
)
from omnisim.rendering.camera.degradations.fixed_pattern import write_pattern


def noise(request: MeasureNoiseRequest) -> None:
    """Measure noise, write a sensor file with its pattern, and print the quantities.

    Raises:
        MeasurementError: frames that cannot be measured.
        SensorFileError: a sensor file with a fault.
        OutputError: a file that cannot be written.
    """
    pattern = request.output.with_name(f"{request.output.stem}-pattern.exr")
    check_outputs(request.output, request.sensor, pattern=pattern)
    tables = sensor_tables(request.sensor)
    measured = measure_noise(
        _statistics(request.dark, "Dark frames"),
        _statistics(request.flat, "Flat fields"),
        bit_depth=request.bit_depth,
        mosaic=request.bayer,
    )
    keys = _keys(measured)
    if measured.pattern is not None:
        write_pattern(pattern, measured.pattern)
        keys["pattern"] = pattern.name
    degradation = {**tables.get("degradation", {}), "noise": keys}
    shutter = degradation.setdefault("shutter", {})
    shutter.setdefault("exposure_s", measured.exposure_s)  # which the dark current needs
    tables = {**tables, "degradation": degradation}
    write_measured(
        "noise",
        request.output,
        request.sensor,
        tables,
        measured.quantities,
        measured.unobservable,
        _details(measured),
    )
    print_measured(request.output, measured.quantities, measured.unobservable)
    if len(measured.defects):
        out.print(f"{len(measured.defects)} defective pixels", markup=False)


def _statistics(folder: Path, title: str) -> list[FrameStatistics]:
    sets = find_frame_sets(folder)
    return [read_statistics(sets[number]) for number in track(range(len(sets)), title, len(sets))]


def _keys(measured: MeasuredNoise) -> dict[str, Any]:
    """Keys of the table `[degradation.noise]`, with no more digits than were measured."""
    digits = {one.name: round_to_sigma(one.value, one.sigma) for one in measured.quantities}
    values = measured.noise.to_table(full=True)
    keys = {key: digits.get(key, value) for key, value in values.items()}
    if measured.pattern is not None:  # which has both
        keys = {key: value for key, value in keys.items() if key not in ("prnu", "dsnu_e")}
    return {key: value for key, value in keys.items() if key != "pattern_seed"}


def _details(measured: MeasuredNoise) -> dict[str, Any]:
    """Photon transfer curve and defective pixels for the report."""
    curve = measured.curve
    return {
        "photon_transfer": {
            "mean_dn": curve.means_dn.tolist(),
            "variance_dn2": curve.variances_dn2.tolist(),
            "used": curve.used.tolist(),
        },
        "defective_pixels": measured.defects[:, ::-1].tolist(),
    }
