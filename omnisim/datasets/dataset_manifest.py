"""Manifest of a data set, `manifest.json`: its shards with their hashes, and its statistics."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnisim.core.errors import PlanError
from omnisim.datasets.generate.shard import ShardSummary, Statistics, file_sha256, find_shard

MANIFEST = "manifest.json"


@dataclass(frozen=True, eq=False)
class Manifest:
    """Manifest of a finished data set."""

    title: str  # title of the data set
    license: str | None  # license of the data set; None: not stated
    plan: str  # fingerprint of the plan
    channels: tuple[str, ...]  # names of the channels of ground truth
    shards: tuple[ShardSummary, ...]  # summaries of the shards, by number

    @property
    def size_bytes(self) -> int:
        """Size of all shards."""
        return sum(shard.size_bytes for shard in self.shards)

    @property
    def statistics(self) -> Statistics:
        """Statistics of all shards."""
        total = Statistics()
        for shard in self.shards:
            total.update(shard.statistics)
        return total

    def to_json(self) -> dict[str, Any]:
        """Content of the manifest, of JSON types."""
        return {
            "title": self.title,
            "license": self.license,
            "plan": self.plan,
            "channels": list(self.channels),
            "bytes": self.size_bytes,
            "statistics": self.statistics.to_json(),
            "shards": [
                {
                    "file": shard.name,
                    "sha256": shard.sha256,
                    "bytes": shard.size_bytes,
                    "samples": shard.statistics.samples,
                }
                for shard in self.shards
            ],
        }


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest of a data set and the summaries of its shards.

    Raises:
        PlanError: the manifest or a shard is missing or damaged.
    """
    path = folder / MANIFEST
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        title, license = str(content["title"]), content["license"]
        plan, channels = str(content["plan"]), tuple(map(str, content["channels"]))
        count = len(content["shards"])
        if not count:
            raise ValueError("no shard")
    except OSError as reason:
        raise PlanError(
            f"{path}: cannot be read: {reason.strerror}: expected a data set that `omnisim "
            "generate` has finished"
        ) from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise PlanError(f"{path}: is damaged: `omnisim generate` writes it again") from None
    summaries = [find_shard(folder, number) for number in range(count)]
    for number, shard in enumerate(summaries):
        if shard is None or shard.plan != plan:
            raise PlanError(
                f"{folder}: shard {number} is missing or damaged: `omnisim generate` makes it again"
            )
    shards = tuple(shard for shard in summaries if shard is not None)
    return Manifest(title, None if license is None else str(license), plan, channels, shards)


def check_hashes(folder: Path, manifest: Manifest) -> Iterator[ShardSummary]:
    """Compare the hash of each shard with the manifest's; yield the shard if they agree.

    Raises:
        PlanError: the message names the first shard that differs, or that cannot be read.
    """
    for shard in manifest.shards:
        path = folder / shard.name
        try:
            sha256 = file_sha256(path)
        except OSError as reason:
            raise PlanError(f"{path}: cannot be read: {reason.strerror}") from None
        if sha256 != shard.sha256:
            raise PlanError(
                f"{path}: is damaged: expected SHA-256 {shard.sha256[:16]}…, got {sha256[:16]}…: "
                "remove it, and `omnisim generate` makes it again"
            )
        yield shard
