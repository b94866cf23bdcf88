import errno
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_channels, read_image, write_channels, write_image
from omnisim.ground_truth.frame import Frame

METADATA = {"camera": {"k": 11.546}, "scene": 'käse "quoted" & <odd>', "pose": [[1.0, 0.1], [0, 1]]}
IMAGE = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".tiff", ".PNG"])
def test_lossless_formats_keep_every_value(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_image(path, IMAGE, METADATA)
    pixels, metadata = read_image(path)
    np.testing.assert_array_equal(pixels, IMAGE)
    assert metadata == METADATA


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg"])
def test_jpeg_is_close_and_keeps_the_metadata(tmp_path, suffix):
    smooth = np.broadcast_to(np.arange(64, dtype=np.uint8)[:, None, None] * 3, (64, 64, 3))
    path = tmp_path / f"a{suffix}"
    write_image(path, smooth.copy(), METADATA)
    pixels, metadata = read_image(path)
    assert np.abs(pixels.astype(int) - smooth).max() <= 4
    assert metadata == METADATA


def test_exr_holds_linear_floats_past_white(tmp_path):
    linear = np.linspace(0.0, 7.5, 24 * 32 * 3, dtype=np.float32).reshape(24, 32, 3)
    path = tmp_path / "a.exr"
    write_image(path, linear, METADATA)
    pixels, metadata = read_image(path)
    assert pixels.dtype == np.float32
    np.testing.assert_array_equal(pixels, linear)
    assert metadata == METADATA


@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_full_disk_leaves_the_old_image(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"a{suffix}"
    image = IMAGE.astype(np.float32) if suffix == ".exr" else IMAGE
    for written in (image[::-1], image):
        write_image(path, written)
        np.testing.assert_array_equal(read_image(path)[0], written)
    before = path.read_bytes()

    def until_full(target, data):
        with target.open("wb") as file:
            file.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    # the only place where an image meets the disk: OpenImageIO encodes into memory
    monkeypatch.setattr(Path, "write_bytes", until_full)
    with pytest.raises(OutputError, match=rf"a\{suffix}: cannot be written: No space left"):
        write_image(path, image[::-1])
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.gif", r"a\.gif: unknown image format: .*got '\.gif'"),
        ("a", "unknown image format: .*got ''"),
        ("a.txt/a.png", r"a\.txt: is a file: expected a folder"),
        ("b.png", r"b\.png: is a folder"),
        ("/proc/a.png", "cannot be written"),
        ("a" * 252 + ".png", "File name too long"),
    ],
)
def test_places_that_cannot_be_written_to(tmp_path, name, words):
    (tmp_path / "a.txt").touch()
    (tmp_path / "b.png").mkdir()
    with pytest.raises(OutputError, match=words):
        write_image(tmp_path / name, IMAGE)
    write_image(tmp_path / ("a" * 251 + ".png"), IMAGE)  # the longest name


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_folder_without_write_permission(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError, match="cannot be written to"):
            write_image(tmp_path / "a.png", IMAGE)
    finally:
        tmp_path.chmod(0o700)


def test_wrong_pixels_for_the_format(tmp_path):
    with pytest.raises(OutputError, match="expected float32 pixels, got uint8"):
        write_image(tmp_path / "a.exr", IMAGE)
    frame = Frame(np.zeros((2, 2, 4), np.uint8), None, {})
    with pytest.raises(OutputError, match="rendered with linear=True"):
        frame.save(tmp_path / "a.exr")


def test_foreign_images_have_no_metadata(tmp_path):
    deeply_nested = PngInfo()
    deeply_nested.add_text("Description", '{"camera":' * 5000)
    for description in (None, deeply_nested):
        Image.fromarray(IMAGE).save(tmp_path / "a.png", pnginfo=description)
        pixels, metadata = read_image(tmp_path / "a.png")
        np.testing.assert_array_equal(pixels, IMAGE)
        assert metadata is None
    (tmp_path / "empty.png").write_bytes(b"")
    with pytest.raises(OutputError, match=r"empty\.png: cannot be read"):
        read_image(tmp_path / "empty.png")
    with pytest.raises(OutputError, match=r"none\.png: cannot be read"):
        read_image(tmp_path / "none.png")


def test_link_stays_a_link(tmp_path):
    (tmp_path / "a.png").symlink_to("real.png")
    write_image(tmp_path / "a.png", IMAGE)
    assert (tmp_path / "a.png").is_symlink()
    np.testing.assert_array_equal(read_image(tmp_path / "real.png")[0], IMAGE)


def _channels():
    depth = np.linspace(0.1, 99.9, 24 * 32, dtype=np.float32).reshape(24, 32)
    depth[3, 5] = np.inf
    label = np.arange(24 * 32, dtype=np.uint16).reshape(24, 32)
    return {"Z": depth, "direction.X": -depth[::-1], "label": label, "valid": label % 2 == 0}


def test_channels_come_back_by_name(tmp_path):
    path = tmp_path / "a.exr"
    channels = _channels()
    write_channels(path, channels, METADATA, {"depth": "range in meters", "scale": 2.5, "n": 3})
    found = read_channels(path)
    assert set(found.values) == set(channels)
    for name, values in channels.items():
        assert found.values[name].dtype == np.float32
        np.testing.assert_array_equal(found.values[name], values.astype(np.float32))
    assert found.metadata == METADATA
    assert found.attributes["depth"] == "range in meters"
    assert (found.attributes["scale"], found.attributes["n"]) == (2.5, 3)
    assert [one.name for one in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.parametrize(
    ("name", "change", "what"),
    [
        ("a.png", {}, "expected a name that ends in .exr"),
        ("a.exr", {"Z": np.zeros((3, 3))}, "channel "),
        ("a.exr", {"label": np.full((24, 32), 1 << 25)}, "channel label: expected whole numbers"),
        ("a.exr", {"label": np.full((24, 32), "x")}, "channel label: expected numbers, got <U1"),
    ],
)
def test_invalid_channels_are_refused(tmp_path, name, change, what):
    with pytest.raises(OutputError, match=what):
        write_channels(tmp_path / name, {**_channels(), **change})
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OutputError, match="at least one channel"):
        write_channels(tmp_path / "b.exr", {})


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".exr"])
def test_equal_images_are_equal_bytes(tmp_path, suffix):
    """Equal images make equal files: OpenEXR's writer would note when it wrote."""
    kind = np.float32 if suffix == ".exr" else np.uint8
    write_image(tmp_path / f"a{suffix}", np.ones((2, 2, 3), kind))
    assert b"capDate" not in (tmp_path / f"a{suffix}").read_bytes()
    assert b"DateTime" not in (tmp_path / f"a{suffix}").read_bytes()


@pytest.mark.parametrize("read", [read_channels, read_image])
def test_files_and_headers_that_are_damaged_are_refused(tmp_path, read):
    path = tmp_path / "a.exr"
    write_channels(path, {"range.X": np.ones((2, 3), np.float32)}, {}, {"comment": "a"})
    whole = path.read_bytes()
    no_utf8 = [whole.replace(word, b"\xff" * len(word)) for word in (b"channels", b"chlist")]
    for content in (None, b"no image", *no_utf8):
        path.unlink() if content is None else path.write_bytes(content)
        with pytest.raises(OutputError, match=r"a\.exr: cannot be read"):
            read(path)


def test_damaged_png_is_refused(tmp_path):
    path = tmp_path / "a.png"
    write_image(path, np.arange(192, dtype=np.uint8).reshape(8, 8, 3))
    whole = bytearray(path.read_bytes())
    whole[whole.index(b"IDAT") + 9] ^= 4
    path.write_bytes(whole)
    with pytest.raises(OutputError, match="cannot be read: b'IDAT' is damaged"):
        read_image(path)
    for end in range(8, len(whole)):
        path.write_bytes(whole[:end])
        with pytest.raises(OutputError, match="cannot be read"):
            read_image(path)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif"])
def test_metadata_that_a_format_cannot_hold_is_refused(tmp_path, suffix):
    """JPEG's writer would end the process, TIFF's reader would find none."""
    pixels, path = np.zeros((4, 4, 3), np.uint8), tmp_path / f"a{suffix}"
    short, long = ({"x": "a" * size} for size in (64_900, 70_000))
    write_image(path, pixels, short)
    assert read_image(path)[1] == short
    path.unlink()
    if suffix == ".png":
        write_image(path, pixels, long)
        assert read_image(path)[1] == long
        return
    with pytest.raises(
        OutputError, match="expected at most 65000 bytes of camera metadata, got 70009"
    ):
        write_image(path, pixels, long)
    assert not list(tmp_path.iterdir())
