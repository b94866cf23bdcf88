"""Names of channels: as they are asked for, and as people mistype them."""

import pytest

from omnisim.errors import OutputError
from omnisim.ground_truth import CHANNELS, check_channels, parse_channels


def test_names_are_unique_and_ordered():
    assert parse_channels("valid, Range,range") == ("range", "valid")
    assert parse_channels("all") == tuple(CHANNELS) == check_channels(reversed(CHANNELS))
    assert parse_channels("range, all") == tuple(CHANNELS)
    assert check_channels(()) == ()


def test_flow_has_its_occlusion():
    assert check_channels(("flow",)) == check_channels(("occluded",)) == ("flow", "occluded")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rnage", "'rnage': there is no such channel; did you mean 'range'?"),
        ("range,semantics", "'semantics': there is no such channel; did you mean 'semantic'?"),
        ("xyzzy", "'xyzzy': there is no such channel; expected one of range, z, position"),
        (" , ", "expected names with commas: range,z"),
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
