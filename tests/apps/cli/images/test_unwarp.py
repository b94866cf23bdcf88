"""`omnisim unwarp`: output, files and errors."""

import json

import numpy as np
import pytest

from omnisim.cameras import camera_from_parameters, pixel_grid
from omnisim.cameras.optics import CentralView
from omnisim.cameras.optics.centrality import directions_at
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.files.image_files import read_channels, read_image, write_image
from tests.apps.cli import image_files
from tests.cameras.optics.examples import SYSTEMS


@pytest.fixture
def image(tmp_path):
    """An image as `omnisim render` writes it, without rendering."""
    pixels, metadata = np.full((360, 360, 3), 128, dtype=np.uint8), image_files.metadata()
    write_image(tmp_path / "a.png", pixels, metadata)
    return metadata


@pytest.mark.usefixtures("image")
@pytest.mark.parametrize(
    ("kind", "suffix"), [("cylinder", ".png"), ("perspective", ".exr"), ("birdseye", ".jpg")]
)
def test_unwarp_and_unwarp_again(quiet, tmp_path, kind, suffix):
    out = quiet("unwarp", "a.png", "--to", kind, "-o", f"b{suffix}")
    assert f"b{suffix}: {kind}, " in out
    pixels, metadata = read_image(tmp_path / f"b{suffix}")
    assert metadata["scene"] == "none"
    if kind == "birdseye":  # up to 4 × the height from the middle
        assert metadata["camera"]["focal_length_px"] == metadata["camera"]["width_px"] / 8
    if suffix != ".jpg":
        masked = int((pixels[..., 3] == 0).sum())
        assert (f"{masked} pixels" in out) == (masked > 0)
        assert (kind == "perspective") == (masked > 0)  # it looks above the rim
    # a view is an image with a camera, too
    options = "-o", "c.png", "--fov", "30", "--pitch", "50", "--yaw", 0 if suffix == ".exr" else 80
    quiet("unwarp", f"b{suffix}", "--to", "perspective", *options)
    pixels, metadata = read_image(tmp_path / "c.png")
    x, y, z = np.array(metadata["world_from_optical"])[:3, 2]  # of a vehicle at 30°
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(30 if suffix == ".exr" else 110)
    assert np.degrees(np.arcsin(-z)) == pytest.approx(50)
    inside = pixels[..., 3] > 0
    assert inside.any()
    assert np.abs(pixels[inside][:, :3].astype(int) - 128).max() <= 2


def test_channels_are_taken_along(ran, quiet, tmp_path, needs_opengl):
    wanted = ["--also", "range,semantic,instance,flow"]
    render = ["render", "soccer", "--size", "48", *wanted, "-o"]
    ran(*render, "a.png")
    view = ["--to", "cylinder", *wanted, "--channel-format", "both", "-o", "b.png"]
    out = quiet("unwarp", "a.png", *view)
    assert "b.png: also range, semantic, instance, flow, occluded" in out
    content = json.loads((tmp_path / "b.channels.json").read_text())
    assert content["camera"]["model"] == "cylindrical"
    assert content["next_world_from_base"] != content["world_from_base"]
    names = {kind["id"]: kind["name"] for kind in content["labels"]["classes"]}
    semantic = np.load(tmp_path / "b.semantic.npy")
    assert "carpet" in {names[number] for number in np.unique(semantic).tolist()}
    height, width = semantic.shape
    assert read_image(tmp_path / "b.png")[0].shape[:2] == (height, width)
    boxes = json.loads((tmp_path / "b.coco.json").read_text())
    assert boxes["images"][0]["width"] == width
    # from an EXR into an EXR, and a view of the view
    ran(*render, "c.exr")
    view = ["--to", "perspective", "--pitch", "40", "--also"]
    quiet("unwarp", "c.exr", *view, "all", "-o", "d.exr")
    layers = read_channels(tmp_path / "d.exr").values
    assert {"R", "A", "range", "flow.U", "instance"} <= set(layers)
    quiet("unwarp", "d.exr", *view, "range", "-o", "e.exr")
    again = read_channels(tmp_path / "e.exr").values["range"]
    np.testing.assert_array_equal(again, layers["range"])


@pytest.mark.usefixtures("image")
def test_channels_that_are_missing_or_would_be_overwritten_leave_no_file(refused):
    command = ["unwarp", "a.png", "--to", "cylinder", "--also", "range", "-o"]
    assert "a.png: no channel 'range'; it has none" in refused(*command, "b.png")
    assert "a.channels.json" in refused(*command, "a.exr")


def test_sensor_file_replaces_metadata(quiet, refused, tmp_path):
    write_image(tmp_path / "a.png", np.full((360, 360, 3), 90, dtype=np.uint8))
    (tmp_path / "s.toml").write_text("[mirror]\ntheta_max_deg = 100\n")
    line = refused("unwarp", "a.png", "--to", "cylinder", "-o", "b.png")
    assert "a.png: has no camera parameters inside: pass the sensor file" in line
    view = ("unwarp", "a.png", "--to", "birdseye", "-o", "b.png", "--sensor", "s.toml")
    line = "a.png: expected the camera's height in the metadata: pass --height METERS"
    assert refused(*view) == line
    out = quiet(*view, "--height", "0.5", "--extent", "1.5", "--size", "64", "64")
    assert "birdseye, 64 × 64 px" in out


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"model": ["hyperbolic"]}, "got ['hyperbolic']"),
        ({"model": {}}, "camera: model: expected one of"),
        ({"k": 10**400}, "camera.k: expected a number, got 1000"),
        ({"focal_length_px": 1e300}, "camera.focal_length_px: expected a number ≤ 1e+30"),
        ({"focal_length_px": 1e-300}, "camera.focal_length_px: expected a number > 0"),
        ({"principal_point_px": [1e300, 0.0]},
         "camera.principal_point_px.0: expected a number ≤ 1e+15"),
        ({"theta_max_deg": 179.0}, "less than the asymptote"),
    ],
)  # fmt: skip
def test_metadata_edited_to_nonsense_gets_one_line(refused, tmp_path, changed, message):
    metadata = image_files.metadata()
    metadata["camera"] |= changed
    write_image(tmp_path / "odd.png", np.zeros((360, 360, 3), dtype=np.uint8), metadata)
    line = refused("unwarp", "odd.png", "--to", "cylinder", "-o", "b.png")
    assert line.startswith("odd.png: its metadata: ")
    assert message in line


@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_nan_is_masked(quiet, tmp_path, image, suffix):
    pixels = np.full((360, 360, 3), 0.25, dtype=np.float32)
    pixels[100:120, 100:120] = np.nan
    pixels[200:210, 260:300] = np.inf
    write_image(tmp_path / "a.exr", pixels, image)
    out = quiet("unwarp", "a.exr", "--to", "cylinder", "-o", f"b{suffix}")
    assert "outside the camera's view are masked" in out
    seen, _ = read_image(tmp_path / f"b{suffix}")
    colors, alpha = seen[..., :3].astype(float), seen[..., 3]
    assert np.all(colors[alpha == 0] == 0.0)
    assert np.ptp(colors[alpha > 0]) < 1e-6


def test_optics_assume_a_viewpoint_and_say_so(ran, tmp_path):
    """Each pixel's color is where its ray is 0.4 m away: there a view from the viewpoint has its
    own directions, if it is right there, and else it is off by what the note says."""  # fmt: skip
    system = SYSTEMS["sphere"]
    viewpoint_m = CentralView(system).viewpoint_m
    rays = system.all_rays()
    directions, _ = directions_at(rays.origins_m, rays.directions, viewpoint_m, 0.4)
    up = system.rig_from_optical
    colors = directions / np.linalg.norm(directions, axis=-1, keepdims=True) @ up.T
    world_from_optical = np.eye(4)
    world_from_optical[:3, :3] = up
    metadata = {
        "camera": system.parameters(),
        "world_from_base": np.eye(4).tolist(),
        "world_from_optical": world_from_optical.tolist(),
    }
    write_image(tmp_path / "a.exr", colors.astype(np.float32), metadata)
    view = "--to", "perspective", "--fov", 60, "--size", 64, 64, "-o", "b.exr"
    for option, low_rad, high_rad in (
        (("--right-at", 0.4), 0.0, 5e-4),  # between pixels of a degree
        # 60° ahead are some 50 px of the image: what the note calls 1 px is 15 mrad
        ((), 5e-4, 2e-2),
    ):
        _, error = ran("unwarp", "a.exr", *view, *option)
        assert "a.exr: rays meet in no point: one is assumed, right for points at" in error
        assert error.count("\n") == 1
        pixels, written = read_image(tmp_path / "b.exr")
        camera = camera_from_parameters(written["camera"])
        expected = camera.ray_from_pixel(pixel_grid(64, 64)).directions
        expected = expected @ BASE_FROM_OPTICAL_LOOKING_AHEAD.T
        found = pixels[..., :3][pixels[..., 3] > 0]
        off_rad = np.linalg.norm(found - expected[pixels[..., 3] > 0], axis=-1)
        assert low_rad < np.median(off_rad) < high_rad
        height_m = written["world_from_optical"][2][3]
        assert height_m == pytest.approx((up @ viewpoint_m)[2])


def test_a_calibration_replaces_metadata(ran, quiet, refused, tmp_path):
    """The camera's own calibration gives the view that its metadata gives."""
    lens = (
        '[lens]\nmodel = "equidistant"\nwidth_px = 64\nheight_px = 64\nfocal_length_px = 20\n'
        "principal_point_px = [32, 32]\ntheta_max_deg = 80\n"
    )
    (tmp_path / "s.toml").write_text(lens)
    pixels = np.random.default_rng(0).integers(0, 255, (64, 64, 3), dtype=np.uint8)
    write_image(tmp_path / "a.png", pixels)
    ran("calibration", "convert", "s.toml", "--to", "omnisim", "-o", "c.json")
    view = ("unwarp", "a.png", "--to", "perspective", "--pitch", "-60", "--size", 32, 32)
    for option, file in (("--sensor", "s.toml"), ("--camera", "c.json")):
        quiet(*view, option, file, "-o", f"{option[2:]}.png")
    assert np.array_equal(*(read_image(tmp_path / f"{n}.png")[0] for n in ("sensor", "camera")))
    line = refused(*view, "--sensor", "s.toml", "--camera", "c.json", "-o", "b.png")
    assert line == "--sensor, --camera: expected one of them, got both"
