"""`omnisim measure sharpness`: output, files and errors."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import omnisim as package
from omnisim.cameras.optics import BoardCorners, write_corners
from omnisim.core.files.image_files import write_image, write_numbers
from omnisim.core.srgb import srgb8_from_linear
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.validation.checks.measured.sharpness import gaussian
from tests.measurement.sharpness.edges import edge_image

EDGES = Path(package.__file__).parents[1] / "examples" / "sharpness_edges.py"


@pytest.mark.slow
@pytest.mark.long
def test_camera_of_the_example_is_found(ran, tmp_path):
    """Hidden numbers of the example: widths 3 %, offsets 0.02 px, by images on the GPU."""
    subprocess.run([sys.executable, EDGES, tmp_path / "edges"], check=True)
    lens = tmp_path / "edges" / "lens.toml"
    images = tmp_path / "edges" / "images"
    out, error = ran("measure", "sharpness", images, "--sensor", lens, "-o", "c.toml")
    assert "c.toml: written" in out
    assert "edges left out: too close to the border" in error
    camera = OmniCamera.from_file(tmp_path / "c.toml")
    assert camera.model == OmniCamera.from_file(lens).model
    for radius_px, radial_px, tangential_px in camera.degradation.point_spread.widths_px:
        share = (radius_px / 240.0) ** 2
        # the renderer's nine samples per pixel are a little wider than the pixel
        assert radial_px == pytest.approx(np.hypot(0.5 + 0.5 * share, 0.11), rel=0.03)
        assert tangential_px == pytest.approx(np.hypot(0.5 + 0.2 * share, 0.11), rel=0.03)
    color = camera.degradation.chromatic_aberration
    for radius in (0.4, 0.9, 1.4):
        for offsets, true in (
            (color.red_offsets_px, 0.2 * radius + 0.5 * radius**2),
            (color.blue_offsets_px, -0.1 * radius - 0.6 * radius**2),
        ):
            found = np.polynomial.polynomial.polyval(radius, (0.0, *offsets))
            assert found == pytest.approx(true, abs=0.02)


@pytest.fixture
def edge(tmp_path):
    """Folder with one gray image of one edge, linear, of 16 bits."""
    folder = tmp_path / "edge"
    folder.mkdir()
    values = edge_image(gaussian(0.8), 9.0)
    write_numbers(folder / "0.png", np.rint(65535.0 * values).astype(np.uint16))
    return folder


def test_one_edge(ran, edge, tmp_path):
    out, error = ran("measure", "sharpness", edge, "-o", "c.toml")
    assert "radii apply to images of 80 × 80 px" in error
    assert "lateral color not measured: the images have one channel" in error
    assert "mtf50" in out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.json", "c.toml", "edge"]
    degradation = OmniCamera.from_file(tmp_path / "c.toml").degradation
    ((_, radial_px, tangential_px),) = degradation.point_spread.widths_px
    assert radial_px == tangential_px == pytest.approx(0.8, rel=0.01)
    assert degradation.chromatic_aberration is None
    report = json.loads((tmp_path / "c.json").read_text())["sharpness"]
    assert report["size_px"] == [80, 80]
    assert report["edges"][0]["mtf50"][0] == pytest.approx(0.22, abs=0.005)
    assert report["edges"][0]["red_shift_px"] is None


def test_measured_tables_replace_those_that_draw_the_same(ran, edge, tmp_path):
    lens = tmp_path / "lens.toml"
    lens.write_text(
        "[lens]\nmodel = 'perspective'\nwidth_px = 80\nheight_px = 80\nfocal_length_px = 80.0\n"
        "principal_point_px = [39.5, 39.5]\n[degradation]\npreset = 'webcam'\n"
    )
    ran("measure", "sharpness", edge, "--sensor", lens, "-o", "c.toml")
    camera, before = (OmniCamera.from_file(path) for path in (tmp_path / "c.toml", lens))
    assert camera.model == before.model
    assert before.degradation.defocus is not None
    assert camera.degradation.defocus is None
    assert camera.degradation.point_spread is not None
    assert camera.degradation.noise == before.degradation.noise


def test_bad_input(ran, refused, edge, tmp_path):
    jpeg, mixed, straight = (tmp_path / name for name in ("jpeg", "mixed", "straight"))
    for folder in (jpeg, mixed, straight):
        folder.mkdir()
    values = edge_image(gaussian(0.8), 9.0)
    encoded = srgb8_from_linear(np.repeat(values[..., None], 3, axis=2))
    write_image(jpeg / "0.jpg", encoded)
    for name, height in (("0.png", 80), ("1.png", 70)):
        write_numbers(mixed / name, np.rint(65535.0 * values[:height]).astype(np.uint16))
    values = edge_image(gaussian(0.8), 1.0)
    write_numbers(straight / "0.png", np.rint(65535.0 * values).astype(np.uint16))
    grid = np.stack(np.meshgrid(np.arange(3.0), np.arange(3.0)), axis=-1).reshape(-1, 2)
    write_corners(tmp_path / "two.csv", [BoardCorners(grid, 20.0 * grid)] * 2)
    (tmp_path / "lens.toml").write_text("[mirror]\nk = 12.0\n")
    for arguments, expected in (
        (("edge", "-o", "c.json"), "c.json: expected a name that ends in .toml"),
        ((".", "-o", "c.toml"), "edge: expected images (.png .tif"),
        (("jpeg", "-o", "c.toml"), "jpeg/0.jpg: JPEG values are not linear: save raw frames"),
        (("mixed", "-o", "c.toml"), "mixed/1.png: expected images of one size, 80 × 80 px, got"),
        (("straight", "-o", "c.toml"), "straight/0.png and others: none of 2 edges is usable; 2"),
        (("edge", "-o", "c.toml", "--corners", "two.csv"), "two.csv: expected the corners of all"),
        (("edge", "-o", "c.toml", "--sensor", "s.toml"), "s.toml: cannot be read"),
        (("edge", "-o", "c.toml", "--sensor", "lens.toml"), "edge/0.png: 80 × 80 px: expected 360"),
    ):
        assert refused("measure", "sharpness", *arguments).startswith(expected)
    ran("measure", "sharpness", "jpeg", "-o", "c.toml", "--response", "srgb")
