"""Files of ground truth, read back by somebody else's rules and by our own."""

import json
import struct

import numpy as np
import pytest

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_channels, read_image, write_channels
from omnisim.ground_truth import CHANNELS, ClassLabel, InstanceLabel, Labels
from omnisim.ground_truth.boxes import coco_image, merged
from omnisim.ground_truth.channel_files import StoredChannels, write_exr
from omnisim.ground_truth.frame import Frame
from omnisim.ground_truth.previews import preview

METADATA = {"scene": "test"}
LABELS = Labels(
    (ClassLabel(1, "ball", (255, 0, 0)), ClassLabel(300, "goal", (0, 0, 255))),
    (InstanceLabel(1, "ball_01", 1), InstanceLabel(2, "goal_a", 300), InstanceLabel(3, "x", 300)),
    "table",
)


def _channels(height=7, width=9):
    """Every channel, with what is special about it: nothing in the first row, invalid corner."""
    random = np.random.default_rng(3)
    hit = np.ones((height, width), dtype=bool)
    hit[0] = False
    normals = random.normal(size=(height, width, 3))
    normals *= hit[..., None] / np.linalg.norm(normals, axis=-1, keepdims=True)
    instance = np.where(hit, random.integers(1, 4, hit.shape), 0).astype(np.uint32)
    flow = random.uniform(-700, 700, (height, width, 2)).astype(np.float32)
    flow[0, 0] = np.nan
    valid = np.ones(hit.shape, dtype=np.uint8)
    valid[0, 0] = 0
    occlusion = random.integers(0, 3, hit.shape).astype(np.uint8)
    occlusion[0, 0] = 255
    motion = np.where(hit[..., None], random.normal(size=(*hit.shape, 3)), np.nan)
    motion = motion.astype(np.float32)
    distances = random.uniform(0.2, 90.0, hit.shape).astype(np.float32)
    return {
        "range": np.where(hit, distances, np.float32(np.inf)),
        "range_through": np.where(hit, 2.0 * distances, np.float32(np.inf)),
        "z": np.where(hit, distances - 50, np.float32(np.inf)).astype(np.float32),
        "position": np.where(hit[..., None], random.normal(size=(height, width, 3)), np.nan),
        "normals": normals.astype(np.float32),
        "normals_camera": -normals.astype(np.float32),
        "albedo": (random.uniform(size=normals.shape) * hit[..., None]).astype(np.float32),
        "roughness": np.where(hit, random.uniform(size=hit.shape), np.nan).astype(np.float32),
        "metallic": np.where(hit, instance == 1, np.nan).astype(np.float32),
        "emissive": (random.uniform(0, 40, normals.shape) * hit[..., None]).astype(np.float32),
        "semantic": LABELS.class_of_instance[instance],
        "semantic_through": LABELS.class_of_instance[instance[:, ::-1]],
        "instance": instance,
        "flow": flow,
        "occluded": occlusion,
        "flow_backward": -flow,
        "occluded_backward": occlusion,
        "scene_flow": motion,
        "scene_flow_camera": -motion,
        "valid": valid,
    }


def _frame(channels):
    shape = channels["range"].shape
    rgba = np.full((*shape, 4), 200, dtype=np.uint8)
    linear = np.full((*shape, 3), 0.25, dtype=np.float32)
    has_ray = None if "valid" not in channels else channels["valid"] == 1
    return Frame(rgba, linear, METADATA, channels, LABELS, has_ray)


def _described(image):
    """Description of the channels beside an image."""
    return json.loads(image.with_suffix(".channels.json").read_text())


def test_exr_holds_all_channels(tmp_path):
    channels = _channels()
    assert channels.keys() == CHANNELS.keys()
    _frame(channels).save(tmp_path / "frame.exr")
    found = read_channels(tmp_path / "frame.exr")
    for name, values in channels.items():
        parts = values.reshape(*values.shape[:2], -1)
        for index, part in enumerate(CHANNELS[name].layers):
            np.testing.assert_array_equal(
                found.values[part], parts[..., index].astype(np.float32), err_msg=part
            )
    np.testing.assert_array_equal(found.values["G"], np.float32(0.25))
    labels = found.metadata["labels"]
    assert {"id": 300, "name": "goal", "color": [0, 0, 255]} in labels["classes"]
    assert {"id": 2, "name": "goal_a", "class": 300} in labels["instances"]
    assert json.loads((tmp_path / "frame.coco.json").read_text())["images"][0]["width"] == 9


def test_files_beside_a_image_are_described(tmp_path):
    channels = _channels()
    _frame(channels).save(tmp_path / "a.png")
    document = _described(tmp_path / "a.png")
    there = {path.name for path in tmp_path.iterdir()}
    named = {name for channel in document["channels"].values() for name in channel["files"]}
    assert there == named | {"a.png", "a.channels.json", "a.coco.json"}
    assert document["labels"]["classes"][0]["name"] == "nothing"

    hit = np.isfinite(channels["range"])
    steps, _ = read_image(tmp_path / "a.range.png")
    assert steps.dtype == np.uint16
    described = document["channels"]["range"]
    scale = described["steps_per_m"]
    assert scale == 500  # of 1000, 500, 200 …: the farthest is beyond 65.534 m
    np.testing.assert_allclose(
        steps[hit, 0] / scale, channels["range"][hit], atol=0.5 / scale + 1e-5
    )
    valid = channels["valid"] == 1
    assert (steps[~hit & valid, 0] == described["nothing_hit"]).all()
    assert (steps[~valid, 0] == described["outside"]).all()
    assert (described["nothing_hit"], described["outside"]) == (65535, 0)
    assert "inf" not in described["about"]

    normals, _ = read_image(tmp_path / "a.normals.png")
    scale = document["channels"]["normals"]
    decoded = (normals.astype(float) - scale["zero"]) / scale["steps_per_unit"]
    np.testing.assert_allclose(decoded[hit], channels["normals"][hit], atol=2e-5)
    assert not normals[~hit].any()
    for name in ("semantic", "instance", "occluded"):
        numbers, _ = read_image(tmp_path / f"a.{name}.png")
        np.testing.assert_array_equal(numbers[..., 0], channels[name])
    assert read_image(tmp_path / "a.semantic.png")[0].dtype == np.uint16  # a class is number 300
    valid, _ = read_image(tmp_path / "a.valid.png")
    np.testing.assert_array_equal(valid[..., 0] > 0, channels["valid"] > 0)


@pytest.mark.parametrize("image", ["a.png", "a.exr"])
def test_npy_files_are_the_arrays_and_the_same_as_the_exr(tmp_path, image):
    channels = _channels()
    frame = _frame(channels)
    frame.save(tmp_path / "b.exr")
    layers = read_channels(tmp_path / "b.exr").values
    frame.save(tmp_path / image, channel_format="npy")
    there = {path.name for path in tmp_path.glob("a.*")}
    arrays = {f"a.{name}.npy" for name in CHANNELS}
    assert there == arrays | {image, "a.channels.json", "a.coco.json"}
    document = _described(tmp_path / "a.png")
    for name, values in channels.items():
        found = np.load(tmp_path / f"a.{name}.npy")
        assert found.dtype == values.dtype
        np.testing.assert_array_equal(found, values)
        described = document["channels"][name]["npy"]
        assert (described["dtype"], tuple(described["shape"])) == (found.dtype.name, found.shape)
        planes = found.reshape(*found.shape[:2], -1).astype(np.float32)
        for index, layer in enumerate(CHANNELS[name].layers):
            np.testing.assert_array_equal(
                layers[layer].view(np.uint32), planes[..., index].view(np.uint32), err_msg=layer
            )
    assert document["labels"]["classes"][0]["name"] == "nothing"


def test_both_formats_leave_the_files_of_each(tmp_path):
    channels = {"range": _channels()["range"]}
    _frame(channels).save(tmp_path / "a.png")
    plain = (tmp_path / "a.range.png").read_bytes()
    _frame(channels).save(tmp_path / "a.png", channel_format="both")
    assert (tmp_path / "a.range.png").read_bytes() == plain
    described = _described(tmp_path / "a.png")["channels"]["range"]
    assert described["files"] == ["a.range.png"]
    assert described["npy"]["file"] == "a.range.npy"
    _frame(channels).save(tmp_path / "b.exr", channel_format="both")
    assert {"range", "R"} <= set(read_channels(tmp_path / "b.exr").values)
    np.testing.assert_array_equal(np.load(tmp_path / "b.range.npy"), channels["range"])
    with pytest.raises(OutputError, match="channel format: expected one of auto, npy, both, got"):
        _frame(channels).save(tmp_path / "c.png", channel_format="csv")
    assert not (tmp_path / "c.png").exists()


@pytest.mark.parametrize(
    ("farthest_m", "steps_per_m"),
    [(0.0, 1000), (65.5344, 1000), (65.535, 500), (131.0, 500), (131.07, 200), (1e3, 50),
     (1e5, 0.5)],
)  # fmt: skip
def test_ranges_have_the_finest_scale_that_holds_them(tmp_path, farthest_m, steps_per_m):
    ranges = np.array([[1e-6, farthest_m], [np.inf, np.inf]], dtype=np.float32)
    rgba = np.full((2, 2, 4), 255, dtype=np.uint8)
    rgba[1, 0, 3] = 0
    Frame(rgba, None, {}, {"range": ranges}).save(tmp_path / "a.png")
    described = _described(tmp_path / "a.png")["channels"]["range"]
    assert described["steps_per_m"] == steps_per_m
    steps = read_image(tmp_path / "a.range.png")[0][..., 0]
    assert steps[0].tolist() == [1, max(1, round(float(ranges[0, 1]) * steps_per_m))]
    assert steps[1].tolist() == [0, 65535]


def test_pngs_of_numbers_claim_no_color_space_and_ranges_state_their_unit(tmp_path):
    _frame(_channels()).save(tmp_path / "a.png")
    names = {"semantic", "instance", "flow", "normals", "range"}
    for name in names:
        data, found, at = (tmp_path / f"a.{name}.png").read_bytes(), set(), 8
        while at < len(data):
            length, kind = struct.unpack(">I4s", data[at : at + 8])
            found.add(kind)
            at += 12 + length
        assert not found & {b"sRGB", b"gAMA", b"cHRM", b"iCCP"}, name
    stated = read_image(tmp_path / "a.range.png")[1]
    described = _described(tmp_path / "a.png")["channels"]["range"]
    assert stated["unit"] == "m"
    assert stated.items() - {("channel", "range")} <= described.items()


def test_flow_files_follow_middlebury_and_kitti(tmp_path):
    channels = _channels()
    flow = channels["flow"]
    known = np.isfinite(flow).all(axis=-1)
    _frame(channels).save(tmp_path / "a.png")
    data = (tmp_path / "a.flow.flo").read_bytes()
    magic, width, height = struct.unpack("<fii", data[:12])
    assert (magic, width, height) == (202021.25, 9, 7)
    values = np.frombuffer(data[12:], "<f4").reshape(7, 9, 2)
    np.testing.assert_array_equal(values[known], flow[known])
    assert (values[~known] > 1e9).all()
    png, _ = read_image(tmp_path / "a.flow.png")
    fits = known & np.all(np.abs(flow) < 511.9, axis=-1)
    np.testing.assert_array_equal(png[..., 2] == 1, fits)
    assert 0 < fits.sum() < known.sum()
    decoded = (png[..., :2].astype(float) - 2**15) / 64.0
    np.testing.assert_allclose(decoded[fits], flow[fits], atol=0.5 / 64 + 1e-4)


def test_boxes_and_masks_match_visible_pixels():
    instances = _channels()["instance"]
    instances[:, 4:] = 0
    instances[2:, 0] = 3
    instances[-1, -1] = 2  # the very last pixel of the column order
    content = coco_image(instances, LABELS, "a.png", 5)
    found = {one["instance_id"]: one for one in content["annotations"]}
    assert set(found) == set(np.unique(instances[instances > 0]).tolist())
    for number, one in found.items():
        mask = np.zeros(instances.size, dtype=bool)
        place, value = 0, False
        for count in one["segmentation"]["counts"]:
            mask[place : place + count] = value
            place, value = place + count, not value
        assert place == instances.size
        np.testing.assert_array_equal(mask.reshape(instances.shape[::-1]).T, instances == number)
        rows, columns = np.nonzero(instances == number)
        x, y, width, height = one["bbox"]
        assert (x, y) == (columns.min(), rows.min())
        assert (x + width - 1, y + height - 1) == (columns.max(), rows.max())
        assert one["area"] == len(rows)
        assert one["category_id"] == LABELS.class_of_instance[number]
    both = merged([content, coco_image(instances, LABELS, "b.png", 6)], LABELS)
    ids = [one["id"] for one in both["annotations"]]
    assert len(set(ids)) == len(ids) == 2 * len(found)
    assert {one["image_id"] for one in both["annotations"]} == {5, 6}
    assert coco_image(np.zeros((3, 4), dtype=int), LABELS, "c.png")["annotations"] == []


@pytest.mark.parametrize("name", CHANNELS)
def test_previews_are_black_without_a_hit_only(name):
    channels = _channels()
    colors = preview(name, channels[name], LABELS)
    assert colors.shape == (7, 9, 3)
    assert colors.dtype == np.uint8
    assert not colors[0, 0].any()
    assert colors[1:].any(axis=-1).mean() > 0.8
    nothing = np.full_like(channels[name], CHANNELS[name].empty)
    assert not preview(name, nothing, LABELS).any()


def test_instances_beyond_16_bits_are_refused(tmp_path):
    channels = _channels()
    channels["instance"][3, 3] = 70_000
    with pytest.raises(OutputError, match="70000 instances: 16 bits hold 65535"):
        _frame({name: channels[name] for name in ("range", "instance")}).save(tmp_path / "a.png")


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
    bounds = {"range": 1e-3, "range_through": 2.5e-3}  # beyond 131 m a step is 5 mm
    bounds |= {"normals": 2e-5, "normals_camera": 2e-5, "albedo": 5e-3, "position": 1e-6}
    bounds |= {"roughness": 1e-5, "metallic": 1e-5}  # of 65534 steps
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
    with pytest.raises(OutputError, match=r"a\.png: no channel 'flow'; it has range"):
        stored.read(["flow"])
    with pytest.raises(OutputError, match="scene: differs from the image's: these are channels"):
        StoredChannels(tmp_path / "a.png", {"scene": "other"})
    with pytest.raises(OutputError, match="it has none"):
        StoredChannels(tmp_path / "b.png", METADATA).read(["range"])
    (tmp_path / "a.range.npy").write_bytes(b"\x93NUMPY")
    with pytest.raises(OutputError, match=r"a\.range\.npy: expected an array of numbers"):
        stored.read(["range"])
    np.save(tmp_path / "a.range.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(OutputError, match=r"a\.range\.npy: expected an array of numbers"):
        stored.read(["range"])
    for text, words in (
        ("[1]", "expected JSON"),
        ('{"scene": "test", "channels": [1]}', "channels: expected a table of channels"),
    ):
        (tmp_path / "a.channels.json").write_text(text)
        with pytest.raises(OutputError, match=words):
            StoredChannels(tmp_path / "a.png", METADATA)


@pytest.mark.parametrize("name", ["\x1b[31m\n", "../a.png", 3])
def test_what_is_no_files_name_is_refused_in_one_line(tmp_path, name):
    _frame({"range": _channels()["range"]}).save(tmp_path / "a.png")
    content = _described(tmp_path / "a.png")
    content["channels"]["range"]["files"] = [name]
    (tmp_path / "a.channels.json").write_text(json.dumps(content))
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
