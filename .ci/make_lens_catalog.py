"""Make the catalog of lenses from a checkout of gyroflow/lens_profiles.

python .ci/make_lens_catalog.py CHECKOUT
"""

from __future__ import annotations

import json
import lzma
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from omnisim.cameras.calibration.calibration import load_calibration
from omnisim.cameras.catalog import lens_catalog
from omnisim.cameras.catalog.lens_catalog import FILE, CatalogFields, rank, slug
from omnisim.core.errors import OmnisimError

TARGET = Path(lens_catalog.__file__).with_name(FILE)


def fields_of(profile: dict[str, Any]) -> CatalogFields:
    """Columns of a profile; numbers keep nine digits."""
    lens = profile["fisheye_params"]
    (fx, _, cx), (_, fy, cy), _ = lens["camera_matrix"]
    stretches = [profile.get(f"input_{axis}_stretch") or 1.0 for axis in ("horizontal", "vertical")]
    readout_ms = profile.get("frame_readout_time") or 0.0
    size = profile["calib_dimension"]

    def text(key: str) -> str:
        return " ".join(str(profile.get(key) or "").split())

    return CatalogFields(
        text("camera_brand"), text("camera_model"), text("lens_model"), text("camera_setting"),
        text("note"), str(size["w"]), str(size["h"]),
        "" if stretches == [1.0, 1.0] else " × ".join(f"{one:g}" for one in stretches),
        *(f"{value:.9g}" for value in (fx, fy, cx, cy, *lens["distortion_coeffs"])),
        f"{lens['RMS_error']:.3g}", str(profile["num_images"]),
        f"{readout_ms:.5g}" if readout_ms > 0.0 else "",
        "global" if profile.get("global_shutter") else "",
        "official" if profile.get("official") else "", text("date"),
    )  # fmt: skip


def main(checkout: Path) -> None:
    """Write the catalog, and print what it has."""
    profiles: list[CatalogFields] = []
    refused: Counter[str] = Counter()
    for path in sorted(checkout.rglob("*.json")):
        try:
            load_calibration(path)
        except OmnisimError as reason:
            refused[str(reason).removeprefix(f"{path}: ").split(",")[0]] += 1
            continue
        profiles.append(fields_of(json.loads(path.read_text(encoding="utf-8"))))
    lines, names = [], Counter[str]()
    for fields in sorted(dict.fromkeys(profiles), key=rank):
        mode = slug(f"{fields.lens} {fields.setting} {fields.width_px}x{fields.height_px}")
        name = f"{slug(fields.maker)}/{slug(fields.model)}/{mode}"
        names[name] += 1
        unique = name if names[name] == 1 else f"{name}~{names[name]}"
        lines.append("\t".join((unique, *fields)))
    text = "".join(f"{line}\n" for line in sorted(lines))
    TARGET.write_bytes(lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME))
    print(f"{len(lines)} of {len(profiles) + refused.total()} profiles, {TARGET.stat().st_size} B")
    print(*(f"{count} refused: {reason}" for reason, count in refused.most_common()), sep="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
