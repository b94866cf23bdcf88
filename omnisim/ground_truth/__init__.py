"""Ground-truth channels as data: names, units, labels and files.

`omnisim.rendering.truth` computes them.
"""

from omnisim.ground_truth.channels import CHANNELS, Channel, check_channels, parse_channels
from omnisim.ground_truth.label_names import ClassLabel, InstanceLabel, Labels

__all__ = [
    "CHANNELS", "Channel", "ClassLabel", "InstanceLabel", "Labels", "check_channels",
    "parse_channels",
]  # fmt: skip
