"""Raw files, videos and ROS bags as images to measure."""

from pathlib import Path

import numpy as np
import pytest

from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry.board_detection import image_files, read_gray
from omnisim.measurement.inputs import is_lossy, read_mosaic, read_photo
from omnisim.measurement.inputs.recorded_frames import MAX_FRAMES
from tests.measurement.inputs.raw_file import write_dng

STAMP_NS = 10**9


def test_a_raw_file_is_linear_from_black_to_white(tmp_path):
    pytest.importorskip("rawpy")
    mosaic = np.full((64, 96), 256 + 1000, dtype=np.uint16)
    mosaic[::2, ::2] = 256 + 500  # red
    mosaic[1::2, 1::2] = 256 + 2000  # blue
    write_dng(tmp_path / "a.dng", mosaic, black=256, white=256 + 4000)
    np.testing.assert_array_equal(read_mosaic(tmp_path / "a.dng")[..., 0], mosaic)
    middle = read_photo(tmp_path / "a.dng")[32, 48].astype(np.float64) / 65535.0
    np.testing.assert_allclose(middle, [0.125, 0.25, 0.5], rtol=2e-3)


@pytest.mark.parametrize(
    ("name", "content", "read", "message"),
    [
        ("a.dng", b"II*\0" + bytes(60), read_photo, r"a\.dng: cannot be read"),
        ("clip.mp4", b"no video", image_files, r"clip\.mp4: cannot be read as a video"),
    ],
)
def test_a_damaged_file_is_named(name, content, read, message, tmp_path):
    pytest.importorskip("rawpy")
    pytest.importorskip("av")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeasurementError, match=message):
        read(tmp_path / name)


def test_frames_of_a_video_are_spread_over_it(tmp_path):
    pytest.importorskip("av")
    from omnisim.plots.video_file import write_video

    levels = np.linspace(20, 230, MAX_FRAMES + 50).astype(np.uint8)
    frames = (np.full((32, 48, 3), level, dtype=np.uint8) for level in levels)
    write_video(tmp_path / "clip.mp4", frames, 25.0)
    files = image_files(tmp_path / "clip.mp4")
    assert len(files) == MAX_FRAMES
    assert all(is_lossy(file) for file in files)
    seen = np.array([read_gray(file).mean() for file in files])
    assert (np.diff(seen) > -1.0).all()
    np.testing.assert_allclose(seen[[0, -1]], [20.0, 230.0], atol=3.0)


@pytest.fixture
def bag(tmp_path):
    pytest.importorskip("rosbags")
    from omnisim.core.files.image_files import image_bytes
    from omnisim.datasets.export.ros2.bag_format import Bag
    from omnisim.datasets.export.ros2.ros_messages import compressed_image, image

    pixels = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)
    with Bag.open(tmp_path / "drive", "mcap") as written:
        for number in range(3):
            stamp = STAMP_NS * (number + 1)
            written.write("/front", stamp, image(stamp, "camera", pixels + number))
            png = image_bytes(tmp_path / "a.png", pixels + number)
            written.write("/rear", stamp, compressed_image(stamp, "camera", png))
    return tmp_path / "drive", pixels


@pytest.mark.parametrize("topic", ["/front", "/rear"])
def test_images_of_a_bag_s_topic_are_read(bag, topic):
    folder, pixels = bag
    files = image_files(Path(f"{folder}#{topic}"))
    for number, file in enumerate(files):
        np.testing.assert_array_equal(read_photo(file), pixels + number)
    assert len(files) == 3


def test_several_topics_need_a_choice(bag):
    with pytest.raises(MeasurementError, match=r"several topics, /front, /rear: select one"):
        image_files(bag[0])
    with pytest.raises(MeasurementError, match="topic /left: expected one of /front, /rear"):
        image_files(Path(f"{bag[0]}#/left"))
