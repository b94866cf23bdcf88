"""Rendered frames: images with metadata and ground truth."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Bytes, Floats32
from omnisim.core.errors import OutputError, did_you_mean
from omnisim.core.files.image_files import is_float_format, png_bytes, write_image
from omnisim.core.short_repr import short_repr
from omnisim.ground_truth.boxes import InstanceBox, boxes_json, write_json
from omnisim.ground_truth.channel_files import (
    BOXES_3D,
    ChannelFormat,
    sidecar_path,
    write_boxes,
    write_exr,
    write_previews,
    write_sidecars,
)
from omnisim.ground_truth.channels import CHANNELS
from omnisim.ground_truth.label_names import Labels
from omnisim.ground_truth.previews import preview


@dataclass(frozen=True, eq=False)
class Frame:
    """Rendered image with metadata and ground truth, first row at the top.

    Attributes:
        rgba: (height, width, 4) uint8, sRGB; alpha is 255 where the camera sees the scene.
        linear: (height, width, 3) float32 linear RGB, if requested.
        metadata: camera, mirror, scene and pose, as JSON-compatible values.
        channels: requested ground truth by name, (height, width) or (height, width, n); see
            `omnisim.ground_truth.CHANNELS`. Notebooks show previews.
        labels: labels of the class and instance IDs; None: no channels.
        has_ray: (height, width) mask, false where a pixel's center is outside the lens or the
            mirror; None: no channels.
        boxes_3d: oriented boxes of the visible instances, if requested.
    """

    rgba: Bytes
    linear: Floats32 | None
    metadata: dict[str, Any]
    channels: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    labels: Labels | None = None
    has_ray: Bools | None = None
    boxes_3d: tuple[InstanceBox, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", FrameChannels(self.channels, self.labels))

    def __repr__(self) -> str:
        height, width = self.rgba.shape[:2]
        camera = self.metadata.get("camera")
        return short_repr(
            self,
            f"{width} × {height} px",
            f"scene {self.metadata['scene']!r}" if "scene" in self.metadata else "",
            f"model {camera['model']!r}" if isinstance(camera, dict) else "",
            "linear" if self.linear is not None else "",
            f"channels {' '.join(self.channels)}" if self.channels else "",
        )

    def _repr_png_(self) -> bytes:
        """PNG file of the image, for display in notebooks."""
        return png_bytes(self.rgb)

    @property
    def rgb(self) -> Bytes:
        """Colors (height, width, 3) uint8, sRGB; black where the camera sees nothing."""
        return self.rgba[..., :3]

    @property
    def valid(self) -> Bools:
        """Mask (height, width), true if at least half of a pixel's samples show the scene."""
        return self.rgba[..., 3] > 0

    def save(self, path: str | Path, previews: bool = False, channel_format: str = "auto") -> None:
        """Write PNG, JPEG or TIFF (sRGB), or EXR (linear float), with embedded metadata.

        In an EXR file, channels are layers. With the other formats they are separate files, see
        `omnisim.ground_truth.channel_files`. Boxes of the instances are in `<stem>.coco.json` and
        `<stem>.boxes_3d.json`.

        Args:
            path: path of the image.
            previews: also write false-color images of the channels, such as
                `<stem>.range.preview.png`.
            channel_format: "npy": arrays such as `<stem>.range.npy` in place of the files above,
                with `<stem>.channels.json`; "auto": the files above; "both".

        Raises:
            OutputError: an unknown format, EXR without a linear image, or a file that cannot be
                written.
        """
        path, files = Path(path), ChannelFormat.parse(channel_format)
        if not is_float_format(path):
            write_image(path, self.rgb, self.metadata)
        elif self.linear is None:
            raise OutputError(
                f"{path}: EXR holds linear colors: expected a frame rendered with linear=True"
            )
        elif self.channels and files is not ChannelFormat.NPY:
            write_exr(path, self.channels, self.labels, self.metadata, self.linear)
        else:
            write_image(path, self.linear, self.metadata)
        if self.channels and not (is_float_format(path) and files is ChannelFormat.AUTO):
            has_ray = self.valid if self.has_ray is None else self.has_ray
            write_sidecars(path, self.channels, self.labels, self.metadata, has_ray, files)
        write_boxes(path, self.channels, self.labels)
        if self.boxes_3d is not None and self.labels is not None:
            boxes = boxes_json(self.boxes_3d, self.labels, path.name, self.metadata)
            write_json(sidecar_path(path, BOXES_3D), boxes)
        if previews:
            write_previews(path, self.channels, self.labels)


class FrameChannels(dict[str, NDArray[Any]]):
    """Ground truth of a frame: arrays (height, width) or (height, width, n) by name.

    Notebooks show previews, with the colors of the labels, if any.
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
            data = b64encode(png_bytes(preview(name, values, self._labels))).decode("ascii")
            unit = f", {CHANNELS[name].unit}" if CHANNELS[name].unit else ""
            figures.append(
                '<figure style="display: inline-block; margin: 4px; text-align: center">'
                f'<img src="data:image/png;base64,{data}" alt="{name}">'
                f"<figcaption>{name}{unit}</figcaption></figure>"
            )
        return "".join(figures)
