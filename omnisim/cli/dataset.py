"""`omnisim dataset`: what is in a data set."""

from __future__ import annotations

import json
import math

from omnisim.atomic_file import check_distinct, check_target
from omnisim.cli.completion import LAYOUTS
from omnisim.cli.console import out, pluralize, print_note, track
from omnisim.cli.dataset_requests import (
    DatasetCheckRequest,
    DatasetConvertRequest,
    DatasetInfoRequest,
    DatasetViewRequest,
)
from omnisim.cli.generate import sheet
from omnisim.datasets.coco_folder import write_coco
from omnisim.datasets.manifest import MANIFEST, check_hashes, read_manifest
from omnisim.datasets.recordings import write_recordings
from omnisim.datasets.samples import Shards
from omnisim.errors import OutputError, did_you_mean
from omnisim.ground_truth.previews import preview
from omnisim.image_files import write_image


def info(request: DatasetInfoRequest) -> None:
    """Print counts of a data set."""
    manifest = read_manifest(request.folder)
    if request.json:
        out.print(json.dumps(manifest.to_json(), indent=1), markup=False)
        return
    statistics = manifest.statistics
    rows = {
        "title": manifest.title,
        "licence": manifest.licence or "unknown",
        "samples": f"{statistics.samples} in {pluralize(len(manifest.shards), 'shard')}",
        "size": f"{manifest.size_bytes / 1e6:.1f} MB",
        "channels": ", ".join(manifest.channels) or "none",
        "scenes": _counts(statistics.scenes),
        "cameras": _counts(statistics.cameras),
        "drawn again": str(statistics.redrawn),
        "plan": manifest.plan,
    }
    for name, value in rows.items():
        out.print(f"{name:12} {value}", markup=False)


def check(request: DatasetCheckRequest) -> None:
    """Compare the hashes of all shards."""
    manifest = read_manifest(request.folder)
    found = check_hashes(request.folder, manifest)
    count = len(manifest.shards)
    for _ in track(range(count), "check", count):
        next(found)
    out.print(f"{request.folder}: {pluralize(count, 'shard')}, as in {MANIFEST}", markup=False)


def convert(request: DatasetConvertRequest) -> None:
    """Write a data set in another layout."""
    if request.to not in LAYOUTS:
        raise OutputError(f"--to {request.to!r}: {did_you_mean(request.to, LAYOUTS)}")
    shards = Shards(request.folder)
    if request.to == "coco":
        steps = write_coco(shards, request.output)
    else:
        steps = write_recordings(shards, request.to, request.output, print_note)
    for _ in track(range(len(shards)), "convert", len(shards)):
        next(steps)
    next(steps, None)  # what comes after the last
    out.print(f"{request.output}: {pluralize(len(shards), 'sample')}", markup=False)


def view(request: DatasetViewRequest) -> None:
    """Write a sheet of samples and their channels."""
    check_target(request.output)
    check_distinct({"-o": request.output}, {"the manifest": request.folder / MANIFEST})
    shards = Shards(request.folder)
    rows = range(request.first, min(request.first + request.count, len(shards)))
    if not rows:
        raise OutputError(f"--first {request.first}: expected less than {len(shards)} samples")
    samples = []
    for row in track(rows, "view", len(rows)):
        sample = shards[row]
        first = sample if "rgb" in sample else next(iter(sample.values()))
        names = shards.manifest.channels
        samples.append([first["rgb"], *(preview(name, first[name], None) for name in names)])
    write_image(request.output, sheet(samples, math.ceil(math.sqrt(len(samples)))))
    out.print(f"{request.output}: {pluralize(len(rows), 'sample')}", markup=False)


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())
