"""Folders of frames by exposure."""

import numpy as np
import pytest

from omnisim.core.errors import MeasurementError
from omnisim.core.files.image_files import write_image, write_numbers
from omnisim.measurement.noise import find_frame_sets, read_statistics


def _write(folder, name, values):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    write_numbers(path, np.asarray(values))
    return path


def test_exposures_are_the_folders_names(tmp_path):
    for folder in ("10ms", "2.5ms-bright", "1s", "400us"):
        _write(tmp_path, f"{folder}/0.png", np.zeros((2, 3), np.uint16))
    (tmp_path / "notes.txt").write_text("lamp at 3 m")
    exposures = [one.exposure_s for one in find_frame_sets(tmp_path)]
    assert exposures == pytest.approx([400e-6, 2.5e-3, 10e-3, 1.0])


def test_statistics_are_those_of_the_files(tmp_path):
    rng = np.random.default_rng(1)
    frames = rng.integers(100, 4000, (3, 20, 30)).astype(np.uint16)
    for number, frame in enumerate(frames):
        _write(tmp_path, f"10ms/{number}.png", frame)
    statistics = read_statistics(find_frame_sets(tmp_path)[0])
    values = frames.astype(np.float64)
    drift = values.mean(axis=(1, 2)).var(ddof=1)
    assert statistics.count == 3
    assert statistics.exposure_s == pytest.approx(0.01)
    np.testing.assert_allclose(statistics.mean_image_dn, values.mean(axis=0), rtol=1e-14)
    assert statistics.variance_dn2 == pytest.approx(values.var(axis=0, ddof=1).mean() - drift)
    assert statistics.maximum_dn == frames.max()
    assert statistics.clipped == pytest.approx(np.mean(frames == frames.max()))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("exposure_3/0.png", r"exposure_3: expected an exposure time as name, such as 2\.5ms"),
        ("3ms/0.jpg", r"0\.jpg: lossy compression changes the noise: save PNG or TIFF"),
        ("3ms/0.raw", r"0\.raw: expected images \(\.png \.tif \.tiff \.pgm\) only"),
    ],
)
def test_other_names_are_refused(tmp_path, name, message):
    path = tmp_path / name
    path.parent.mkdir()
    path.write_bytes(b"")
    with pytest.raises(MeasurementError, match=message):
        find_frame_sets(tmp_path)


def test_other_folders_and_files_are_refused(tmp_path):
    with pytest.raises(MeasurementError, match="got none"):
        find_frame_sets(tmp_path)
    with pytest.raises(MeasurementError, match="expected a folder with one folder per exposure"):
        find_frame_sets(tmp_path / "none")
    broken = tmp_path / "1ms" / "0.png"
    broken.parent.mkdir()
    broken.write_bytes(b"")
    with pytest.raises(MeasurementError, match=r"0\.png: cannot be read"):
        read_statistics(find_frame_sets(tmp_path)[0])
    write_image(broken, np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(MeasurementError, match="raw frames of one channel, got 3: demosaicing"):
        read_statistics(find_frame_sets(tmp_path)[0])
