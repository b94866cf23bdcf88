"""All channels in one EXR file, together with the image's colors if there are any."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from omnisim.core.files.image_files import write_channels
from omnisim.ground_truth.channels import CHANNELS, CLASSES
from omnisim.ground_truth.label_names import Labels


def write_exr(
    path: Path,
    channels: Mapping[str, NDArray[Any]],
    labels: Labels | None,
    metadata: Mapping[str, Any],
    linear: NDArray[Any] | None = None,
) -> None:
    """Write channels under the names of `Channel.layers`, and optional colors as R, G, B, A.

    All layers are 32-bit floats, which are exact for integers up to 2^24. Positions are relative to
    the world's origin, so float32 rounds distant ones: to 0.1 mm at 1 km. The attributes
    `omnisim:<channel>` describe the channels; the label table is in the metadata.

    Args:
        path: output file.
        channels: channels by name.
        labels: labels of the class and instance IDs; None: no labels.
        metadata: metadata of the image.
        linear: (height, width, 3 or 4) linear colors; None: no colors.

    Raises:
        OutputError: the file cannot be written.
    """
    layers: dict[str, NDArray[Any]] = {}
    if linear is not None:
        layers |= {name: linear[..., index] for index, name in enumerate("RGBA"[: linear.shape[2]])}
    attributes = {}
    for name, values in channels.items():
        channel = CHANNELS[name]
        planes = values.reshape(*values.shape[:2], -1)
        layers |= {layer: planes[..., index] for index, layer in enumerate(channel.layers)}
        unit = f"{channel.unit}; " if channel.unit else ""
        attributes[f"omnisim:{name}"] = f"{', '.join(channel.layers)}: {unit}{channel.about}"
    if labels is not None and channels.keys() & {*CLASSES, "instance"}:
        metadata = {**metadata, "labels": labels.to_json()}
    write_channels(path, layers, metadata, attributes)
