"""Channels of a frame by name, with false-color previews in notebooks."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from omnisim.core.errors import did_you_mean
from omnisim.core.files.image_files import png_bytes
from omnisim.core.short_repr import short_repr
from omnisim.ground_truth.channels import CHANNELS
from omnisim.ground_truth.label_names import Labels


class FrameChannels(dict[str, NDArray[Any]]):
    """Ground truth of a frame: arrays (height, width) or (height, width, n) by name.

    Args:
        channels: arrays by channel name.
        labels: labels of classes and instances, for the preview colors; None: no labels.
    """

    def __init__(self, channels: Mapping[str, NDArray[Any]], labels: Labels | None = None):
        super().__init__(channels)
        self._labels = labels

    def __missing__(self, name: object) -> NDArray[Any]:
        if name in CHANNELS:
            raise KeyError(f"{name}: not rendered: pass also=({name!r},) to render")
        if not isinstance(name, str):
            raise KeyError(name)
        raise KeyError(f"{name}: there is no such channel; {did_you_mean(name, CHANNELS)}")

    def __repr__(self) -> str:
        return short_repr(self, *self)

    def _repr_html_(self) -> str:
        """Contact sheet of the previews, for display in notebooks."""
        figures = []
        for name, values in self.items():
            from omnisim.ground_truth.previews import preview

            data = b64encode(png_bytes(preview(name, values, self._labels))).decode("ascii")
            unit = f", {CHANNELS[name].unit}" if CHANNELS[name].unit else ""
            figures.append(
                '<figure style="display: inline-block; margin: 4px; text-align: center">'
                f'<img src="data:image/png;base64,{data}" alt="{name}">'
                f"<figcaption>{name}{unit}</figcaption></figure>"
            )
        return "".join(figures)
