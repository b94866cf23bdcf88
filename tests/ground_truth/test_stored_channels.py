"""Channels read back from an image's files."""

import json

import numpy as np
import pytest

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import write_channels
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.channel_files import StoredChannels, write_exr
from omnisim.ground_truth.frame import Frame
from tests.ground_truth.test_channel_files import LABELS, _channels, _frame

METADATA = {"scene": "test"}


@pytest.mark.parametrize(
    ("image", "channel_format"),
    [("a.png", "npy"), ("a.png", "both"), ("a.exr", "auto"), ("a.exr", "npy"), ("a.exr", "both")],
)
def test_arrays_and_exr_files_are_read_exactly(tmp_path, image, channel_format):
    channels = _channels()
    _frame(channels).save(tmp_path / image, channel_format=channel_format)
    stored = StoredChannels(tmp_path / image, METADATA)
    assert stored.names == tuple(CHANNELS)
    assert stored.labels == LABELS
    for name, values in stored.read(CHANNELS).items():
        assert values.dtype == channels[name].dtype
        expected = channels[name]
        if name == "position" and image == "a.exr" and channel_format != "npy":
            expected = expected.astype(np.float32)
        np.testing.assert_array_equal(values, expected, err_msg=name)


def test_sidecars_are_read_in_their_own_steps(tmp_path):
    channels = _channels()
    _frame(channels).save(tmp_path / "a.png")
    found = StoredChannels(tmp_path / "a.png", METADATA).read(CHANNELS)
    bounds = {"range": 1e-3, "normals": 2e-5, "normals_camera": 2e-5, "albedo": 5e-3}
    bounds |= {"roughness": 1e-5, "metallic": 1e-5}  # of 65534 steps
    bounds["position"] = 1e-6
    bounds["range_through"] = 2.5e-3  # beyond 131 m a step is 5 mm
    for name, values in found.items():
        assert values.dtype == channels[name].dtype
        np.testing.assert_allclose(
            values, channels[name], rtol=1e-6, atol=bounds.get(name, 0.0), err_msg=name
        )


def test_a_drive_has_them_beside_its_image(tmp_path):
    channels, camera = _channels(), tmp_path / "omnicam"
    camera.mkdir()
    (tmp_path / "manifest.json").write_text("{}")
    (tmp_path / "labels.json").write_text(json.dumps(LABELS.to_json()))
    write_exr(camera / "000003.channels.exr", channels, None, METADATA)
    stored = StoredChannels(camera / "000003.png", METADATA)
    assert stored.labels == LABELS
    np.testing.assert_array_equal(stored.read(["range"])["range"], channels["range"])


def test_what_is_not_there_or_of_another_image_is_refused(tmp_path):
    channels = _channels()
    _frame({"range": channels["range"]}).save(tmp_path / "a.png", channel_format="npy")
    stored = StoredChannels(tmp_path / "a.png", METADATA)
    with pytest.raises(OutputError, match=r"a\.png: channel 'flow': not there; it has range"):
        stored.read(["flow"])
    with pytest.raises(OutputError, match="scene: differs from the image's: these are channels"):
        StoredChannels(tmp_path / "a.png", {"scene": "other"})
    (tmp_path / "a.range.npy").write_bytes(b"\x93NUMPY")
    with pytest.raises(OutputError, match=r"a\.range\.npy: expected an array of numbers"):
        stored.read(["range"])
    (tmp_path / "a.channels.json").write_text("[1]")
    with pytest.raises(OutputError, match="expected JSON"):
        StoredChannels(tmp_path / "a.png", METADATA)
    (tmp_path / "a.channels.json").write_text('{"scene": "test", "channels": [1]}')
    with pytest.raises(OutputError, match="channels: expected a table of channels"):
        StoredChannels(tmp_path / "a.png", METADATA)
    nothing = StoredChannels(tmp_path / "b.png", METADATA)
    with pytest.raises(OutputError, match="it has none"):
        nothing.read(["range"])


@pytest.mark.parametrize("name", ["\x1b[31m\n", "../a.png", 3])
def test_what_is_no_files_name_is_refused_in_one_line(tmp_path, name):
    _frame({"range": _channels()["range"]}).save(tmp_path / "a.png")
    description = tmp_path / "a.channels.json"
    content = json.loads(description.read_text())
    content["channels"]["range"]["files"] = [name]
    description.write_text(json.dumps(content))
    stored = StoredChannels(tmp_path / "a.png", METADATA)
    with pytest.raises(OutputError, match=r"a\.png: channel 'range': its file is") as error:
        stored.read(["range"])
    assert "\n" not in str(error.value)


def test_numbers_that_are_no_labels_are_refused(tmp_path):
    wrong = np.full((2, 3), np.nan, dtype=np.float32)
    for value in (-1.0, np.inf, np.nan):
        wrong[0, 0] = value
        write_channels(tmp_path / "a.channels.exr", {"instance": wrong}, METADATA)
        with pytest.raises(OutputError, match="channel 'instance': expected uint32"):
            StoredChannels(tmp_path / "a.png", METADATA).read(["instance"])


def test_pickles_are_not_read(tmp_path):
    frame = Frame(np.zeros((2, 2, 4), np.uint8), None, METADATA, {"range": np.ones((2, 2))})
    frame.save(tmp_path / "a.png", channel_format="npy")
    np.save(tmp_path / "a.range.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(OutputError, match=r"a\.range\.npy: expected an array of numbers"):
        StoredChannels(tmp_path / "a.png", METADATA).read(["range"])
