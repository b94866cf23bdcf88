"""Names of channels: as they are asked for, and as people mistype them."""

import re
from pathlib import Path
from typing import get_args

import pytest

import omnisim.ground_truth
from omnisim.apps.cli.option_groups import TruthOptions
from omnisim.apps.cli.options import request_fields
from omnisim.core.errors import OutputError
from omnisim.ground_truth import CHANNELS, check_channels, parse_channels
from omnisim.ground_truth.channels import ChannelName


def test_names_are_unique_and_ordered():
    assert parse_channels("valid, Range,range") == ("range", "valid")
    assert parse_channels("all") == tuple(CHANNELS) == check_channels(reversed(CHANNELS))
    assert parse_channels("range, all") == tuple(CHANNELS)
    assert check_channels(()) == ()


def test_flow_has_its_occlusion():
    assert check_channels(("flow",)) == check_channels(("occluded",)) == ("flow", "occluded")
    backward = ("flow_backward", "occluded_backward")
    assert check_channels(backward[:1]) == check_channels(backward[1:]) == backward


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rnage", "'rnage': there is no such channel; did you mean 'range'?"),
        ("range,semantics", "'semantics': there is no such channel; did you mean 'semantic' or"),
        ("xyzzy", "'xyzzy': there is no such channel; expected one of range, range_through"),
        ("backward_flow", "did you mean 'flow_backward'?"),
        (" , ", "expected names with commas: range,range_through,z"),
    ],
)
def test_unknown_channels_are_refused_with_the_nearest(text, words):
    with pytest.raises(OutputError) as refused:
        parse_channels(text)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_string_is_not_a_list_of_names():
    with pytest.raises(
        OutputError, match=r"channels 'range': expected a list of names, such as \['ra"
    ):
        check_channels("range")


def test_layer_names_are_unique():
    layers = [layer for channel in CHANNELS.values() for layer in channel.layers]
    assert len(set(layers)) == len(layers)
    assert not {"R", "G", "B"} & set(layers)


def test_reference_and_help_name_all_channels():
    readme = (Path(omnisim.ground_truth.__file__).parent / "README.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| `(\w+)", readme, flags=re.MULTILINE))
    first_layers = {name: channel.layers[0].partition(".")[0] for name, channel in CHANNELS.items()}
    assert rows == first_layers
    assert list(rows) == list(CHANNELS)
    (option,) = (field for field in request_fields(TruthOptions) if field.name == "also")
    assert option.text.endswith(f"or all: {' '.join(CHANNELS)}.")


def test_the_type_of_names_has_all_channels():
    assert get_args(ChannelName) == tuple(CHANNELS)
