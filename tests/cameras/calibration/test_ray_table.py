"""Ray tables: written, read back, and broken."""

import numpy as np
import pytest

from omnisim.cameras import MirroredCamera, pixel_grid
from omnisim.cameras.calibration import load_calibration
from omnisim.cameras.calibration.ray_table import read_ray_table, write_ray_table
from omnisim.core.errors import NoticeWarning, OmnisimError, OutputError
from omnisim.core.files.image_files import read_channels, write_channels
from tests.camera_examples import CAMERA_EXAMPLES

FLOAT = np.finfo(np.float32).eps


@pytest.mark.parametrize("name", ["hyperbolic-paper", "unified-kitti-360", "equirectangular-odd"])
def test_table_is_the_camera(tmp_path, name):
    camera = CAMERA_EXAMPLES[name]
    write_ray_table(tmp_path / "rays.exr", camera, {"scene": "a"})
    table = read_ray_table(tmp_path / "rays.exr")
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    np.testing.assert_array_equal(table.valid, rays.valid)
    assert np.abs(table.directions - rays.directions).max() <= FLOAT
    assert not table.origins_m.any()
    assert table.metadata["camera"] == camera.parameters()
    assert table.metadata["scene"] == "a"
    attributes = read_channels(tmp_path / "rays.exr").attributes
    assert attributes["omnisim:frame"].startswith("optical: x right, y down")


def test_what_is_no_ray_table_is_named(tmp_path):
    path = tmp_path / "a.exr"
    write_channels(path, {"Z": np.ones((3, 4))})
    with pytest.raises(OutputError, match=r"a\.exr: .* a channel direction\.X, got Z"):
        read_ray_table(path)
    names = [f"{name}.{axis}" for name in ("direction", "origin") for axis in "XYZ"]
    write_channels(path, {name: np.full((3, 4), 0.9) for name in (*names, "valid")})
    with pytest.raises(OutputError, match="unit vectors where valid is 1, got an error of"):
        read_ray_table(path)
    with pytest.raises(OutputError, match=r"expected a name that ends in \.exr"):
        write_ray_table(tmp_path / "a.png", CAMERA_EXAMPLES["perspective"])


def _rays(camera):
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    return rays.directions, rays.valid


def _table_of(path, camera):
    """Rays of a camera as other programs write them: three channels, 0 where there is no ray."""
    directions, valid = _rays(camera)
    directions = np.where(valid[..., None], 2.0 * directions, 0.0)  # of any length
    if path.suffix == ".exr":
        write_channels(path, {name: directions[..., at] for at, name in enumerate("RGB")})
        return
    rows = np.concatenate((pixel_grid(*valid.shape[::-1]), directions), axis=-1)[valid]
    np.savetxt(path, rows, "%.9g", ",", header="u, v, x, y, z", comments="")


@pytest.mark.parametrize(
    ("name", "suffix"), [("kannala-brandt-tum-vi", ".exr"), ("f-theta-inverse", ".csv")]
)
def test_rays_of_other_programs_are_read_as_the_nearest_model(tmp_path, name, suffix):
    camera = CAMERA_EXAMPLES[name].scaled(0.4)
    path = tmp_path / f"rays{suffix}"
    _table_of(path, camera)
    with pytest.warns(NoticeWarning, match=r"ray_table: read as \w+, RMS .* px off within"):
        found = load_calibration(path).cameras[0].camera
    _, valid = _rays(camera)
    directions, seen = _rays(found)
    # without a rim of five pixels
    assert np.mean(seen & valid) > 0.83 * np.mean(valid)
    pixels = camera.pixel_from_ray(directions[seen & valid]).positions_px
    grid = pixel_grid(camera.width_px, camera.height_px)[seen & valid]
    # 0.05 px: at which the search for a better model ends
    assert np.percentile(np.linalg.norm(pixels - grid, axis=-1), 99.0) < 0.05


def test_a_table_of_a_mirror_looks_into_it(tmp_path):
    camera = CAMERA_EXAMPLES["parabolic"].scaled(0.4)
    _table_of(tmp_path / "rays.exr", camera)
    with pytest.warns(NoticeWarning, match="read as"):
        found = load_calibration(tmp_path / "rays.exr").cameras[0].camera
    assert isinstance(found, MirroredCamera)
    directions, valid = _rays(camera)
    seen = found.pixel_from_ray(directions[valid])
    off = seen.positions_px - pixel_grid(camera.width_px, camera.height_px)[valid]
    assert np.percentile(np.linalg.norm(off, axis=-1)[seen.valid], 99.0) < 0.05


def test_faults_of_tables_are_named(tmp_path):
    path = tmp_path / "a.csv"
    for text, expected in (
        ("x,y\n1,2\n", "expected the header u,v,x,y,z, got x,y"),
        ("u,v,x,y,z\n0,0,0,0,one\n", "a.csv: expected rows of u, v, x, y, z: "),
        ("u,v,x,y,z\n0.5,0,0,0,1\n", "expected whole u and v from 0"),
        ("u,v,x,y,z\n0,0,0,0,1\n", "expected at least 8 × 8 pixels with a ray"),
        ("u,v,x,y,z\n99999,0,0,0,1\n", "expected pixels below 32768, got 99999"),
    ):
        path.write_text(text)
        with pytest.raises(OmnisimError, match=expected):
            load_calibration(path)
    write_channels(tmp_path / "a.exr", {"Y": np.ones((9, 9))})
    with pytest.raises(OmnisimError, match=r"expected channels direction\.X, .* or R, G, B, got Y"):
        load_calibration(tmp_path / "a.exr")
