"""`omnisim dataset`: inspection, checks and conversion of data sets."""

from __future__ import annotations

import json
import math

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.datasets import requests
from omnisim.apps.cli.options import refuse_given
from omnisim.core.errors import OutputError, did_you_mean
from omnisim.core.files.atomic_file import check_distinct, check_target
from omnisim.core.files.image_files import write_image
from omnisim.datasets.converted_datasets import CocoSettings, write_coco, write_recordings
from omnisim.datasets.export.export_formats import LAYOUTS
from omnisim.datasets.generate.samples import MANIFEST, Shards, check_hashes, read_manifest
from omnisim.ground_truth.boxes import BoxLimits
from omnisim.plots.sample_sheet import SampleTiles, channel_tile, sample_sheet
from omnisim.sensors.sensor_table import FOLDER_NAME


def info(request: requests.DatasetInfoRequest) -> None:
    """Print the statistics of a data set."""
    manifest = read_manifest(request.folder)
    if request.json:
        out.print(json.dumps(manifest.to_json(), indent=1))
        return
    statistics = manifest.statistics
    rows = {
        "title": manifest.title,
        "license": manifest.license or "unknown",
        "samples": f"{statistics.samples} in {pluralize(len(manifest.shards), 'shard')}",
        "size": f"{manifest.size_bytes / 1e6:.1f} MB",
        "channels": ", ".join(manifest.channels) or "none",
        "scenes": _counts(statistics.scenes),
        "cameras": _counts(statistics.cameras),
        "redrawn": str(statistics.redrawn),
        "plan": manifest.plan,
    }
    for name, value in rows.items():
        out.print(f"{name:12} {value}")


def check(request: requests.DatasetCheckRequest) -> None:
    """Compare the hash of every shard with the manifest."""
    manifest = read_manifest(request.folder)
    count = len(manifest.shards)
    for _ in track(check_hashes(request.folder, manifest), "check", count):
        pass
    out.print(f"{request.folder}: {pluralize(count, 'shard')}, all hashes as in {MANIFEST}")


def convert(request: requests.DatasetConvertRequest) -> None:
    """Write a data set in another layout."""
    if request.to not in LAYOUTS:
        raise OutputError(f"--to {request.to!r}: {did_you_mean(request.to, LAYOUTS)}")
    for layouts, options in (
        (("coco", "yolo"), ("min_area_px", "min_visible", "split")),
        (("coco",), ("polygons",)),
    ):
        if request.to not in layouts:
            reason = f"requires --to {' or '.join(layouts)}, got --to {request.to}"
            refuse_given(request.coco, reason, *options)
    coco = request.coco
    limits = BoxLimits(coco.min_area_px or 1, coco.min_visible)
    settings = CocoSettings(request.to == "yolo", limits, coco.polygons, _splits(coco.split))
    shards = Shards(request.folder)
    if request.to in ("coco", "yolo"):
        steps = write_coco(shards, request.output, settings)
    else:
        steps = write_recordings(shards, request.to, request.output, print_note)
    for _ in track(steps, "convert", len(shards)):
        pass
    out.print(f"{request.output}: {pluralize(len(shards), 'sample')}")


def _splits(text: str | None) -> dict[str, float]:
    """Parse the shares of splits, by name."""
    if text is None:
        return {}
    splits: dict[str, float] = {}
    for part in text.split(","):
        name, _, share = (word.strip() for word in part.partition("="))
        try:
            number = float(share)
        except ValueError:
            number = math.nan
        if not (FOLDER_NAME.fullmatch(name) and 0.0 < number <= 1.0) or name in splits:
            expected = "expected names with shares, such as train=0.8,val=0.2"
            raise OutputError(f"--split {text!r}: {expected}, got {part.strip()!r}")
        splits[name] = number
    if abs(total := sum(splits.values()) - 1.0) > 1e-6:
        expected = f"expected shares that add up to 1, got {total + 1.0:g}"
        raise OutputError(f"--split {text!r}: {expected}")
    return splits


def view(request: requests.DatasetViewRequest) -> None:
    """Write a sheet of samples and their channels."""
    check_target(request.output)
    check_distinct({"-o": request.output}, {"the manifest": request.folder / MANIFEST})
    shards = Shards(request.folder)
    rows = range(request.first, min(request.first + request.count, len(shards)))
    if not rows:
        expected = f"expected less than {len(shards)}, the number of samples"
        raise OutputError(f"--first {request.first}: {expected}")
    samples = []
    for row in track(rows, "view"):
        sample = shards[row]
        first = sample if "rgb" in sample else next(iter(sample.values()))
        names, metadata = shards.manifest.channels, sample["metadata"]
        channels = [channel_tile(name, first[name]) for name in names]
        title = f"{metadata['number']}: {metadata['scene']}, {metadata['camera']}"
        samples.append(SampleTiles(title, [("rgb", first["rgb"]), *channels]))
    write_image(request.output, sample_sheet(samples))
    out.print(f"{request.output}: {pluralize(len(rows), 'sample')}")


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())
