"""Per-pixel ground truth: channels, labels of classes and instances, and their files."""

from omnisim.ground_truth.channels import CHANNELS, Channel, check_channels, parse_channels
from omnisim.ground_truth.label_names import ClassLabel, InstanceLabel, Labels

__all__ = [
    "CHANNELS",
    "Channel",
    "ClassLabel",
    "InstanceLabel",
    "Labels",
    "check_channels",
    "parse_channels",
]
