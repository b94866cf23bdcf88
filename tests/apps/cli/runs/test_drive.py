"""`omnisim drive`, `plot`, `video` and `export`: output, files and errors."""

import json
import re
import shutil

import numpy as np
import pytest

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_image
from omnisim.core.package_files import SCENES
from omnisim.datasets.export.export_format import ExportSettings
from omnisim.plots.video_file import write_video
from omnisim.rendering.opengl import cube_backend

ROUTE = ["--size", "32", "--step", "2", "--turn-step", "90"]
DRIVE = ["drive", "soccer", "--robot", "superscout", "--path", "lap_clockwise", *ROUTE]


@pytest.fixture(scope="module")
def whole_run():
    """Folder of the drive by its name, once a test has made it."""
    return {}


@pytest.fixture
def run_folder(quiet, needs_opengl, whole_run, tmp_path, tmp_path_factory):
    """Copy of a run that is driven once; its number of steps."""
    if not whole_run:
        assert "run: " in quiet(*DRIVE, "-o", "run")
        whole_run["run"] = tmp_path_factory.mktemp("drive") / "run"
        (tmp_path / "run").rename(whole_run["run"])
    shutil.copytree(whole_run["run"], tmp_path / "run")
    return json.loads((tmp_path / "run" / "manifest.json").read_text())["steps"]


def _decoded(path):
    av = pytest.importorskip("av")
    with av.open(str(path)) as video:
        return [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]


def _blocks(images):
    """Means of 8 × 8 pixels of images: colors are coded at half the resolution."""
    pixels = np.stack(images)
    height, width = (side // 8 for side in pixels.shape[1:3])
    return pixels.reshape(-1, height, 8, width, 8, 3).mean(axis=(2, 4))


def test_a_drive_by_rays_opens_no_opengl(quiet, refused, tmp_path, monkeypatch):
    pytest.importorskip("embreex")
    monkeypatch.setattr(cube_backend, "open_context", None)
    (tmp_path / "path.csv").write_text("x_m,y_m\n0,0\n0.4,0\n")
    drive = ["drive", "soccer", "--robot", "superscout", "--path", "path.csv", "--size", "16"]
    rays = [*drive, "--quality", "fast", "--also", "range", "--backend", "rays", "-o", "run"]
    quiet(*rays)
    image = tmp_path / "run" / "omnicam" / "000000.png"
    before = image.read_bytes()
    assert read_image(image)[0].std() > 20
    image.unlink()
    quiet(*rays)  # resumes
    assert image.read_bytes() == before
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["renderer"].startswith("embreex ")
    line = refused(*drive, "--backend", "rays", "--device", "0", "-o", "other")
    assert line == "--device: expected --backend cube, got --backend rays"


def test_a_robot_without_sensors_says_so(ran, needs_opengl, tmp_path):
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    (tmp_path / "bare.toml").write_text(
        'name = "bare"\n[kinematics]\ntype = "differential"\nmax_speed_mps = 1.0\n'
        "max_turn_rate_degps = 90.0\nmax_acceleration_mps2 = 0.5\n"
        "max_turn_acceleration_degps2 = 90.0\n"
    )
    drive = ["drive", "compass", "--robot", "bare.toml", "--path", "way.csv", "-o", "run"]
    out, error = ran(*drive)
    assert "recorded before" not in out
    assert (
        "note: bare has no sensors: only its path and odometry are recorded: add [[sensors]] to "
        "its robot file\n"
    ) in error


@pytest.mark.slow
def test_drive_plot_and_video(quiet, run_folder, tmp_path):
    out = quiet(*DRIVE, "-o", "run")
    assert f"run: {run_folder} steps, {run_folder} of them recorded before; " in out
    assert re.search(r" s; omnicam: \d+ polygons \(auto\)\n", out)
    assert f"run/plot.png: {run_folder} of {run_folder} steps" in quiet("plot", "run")
    assert read_image(tmp_path / "run" / "plot.png")[0].std() > 20
    quiet("plot", "run", "-o", "plot.svg", "--scene", "soccer")
    assert "<svg" in (tmp_path / "plot.svg").read_text()
    pytest.importorskip("av")
    out = quiet("video", "run", "-o", "run.mp4", "--fps", "5")
    assert f"run.mp4: {run_folder} images, {run_folder / 5:.1f} s" in out


def test_the_video_shows_the_images(ran, run_folder, tmp_path):
    ran("video", "run", "-o", "run.mp4")
    frames = _blocks(_decoded(tmp_path / "run.mp4"))
    files = sorted((tmp_path / "run" / "omnicam").glob("*.png"))
    off = abs(frames[:, None] - _blocks([read_image(file)[0] for file in files])).mean((2, 3, 4))
    assert off.argmin(axis=1).tolist() == list(range(run_folder))
    assert off.diagonal().max() < 8.0


def test_robots_that_drove_together_are_plotted_and_seen_side_by_side(ran, run_folder, tmp_path):
    pytest.importorskip("av")
    (tmp_path / "pair").mkdir()
    shutil.copytree(tmp_path / "run", tmp_path / "pair" / "a")
    (tmp_path / "run").rename(tmp_path / "pair" / "b")
    (tmp_path / "pair" / "b" / "omnicam" / "000002.png").unlink()
    out, error = ran("plot", "pair")
    assert f"pair/plot.png: {run_folder} of {run_folder} steps, 2 of {run_folder} steps" in out
    assert error.startswith("note: pair/b/omnicam/000002.png: is missing")
    assert f"pair.mp4: {run_folder} images" in ran("video", "pair", "-o", "pair.mp4")[0]
    frames = _decoded(tmp_path / "pair.mp4")
    for step, right in ((0, 0), (run_folder - 1, 1)):  # the right one has two images
        files = (f"a/omnicam/{step:06d}.png", f"b/omnicam/{right:06d}.png")
        pixels = [read_image(tmp_path / "pair" / file)[0] for file in files]
        expected = np.concatenate(pixels, axis=1)
        assert frames[step].shape == expected.shape
        assert abs(_blocks([frames[step]]) - _blocks([expected])).mean() < 8.0


def test_images_too_small_for_a_video(tmp_path):
    pytest.importorskip("av")
    with pytest.raises(OutputError, match=r"at least 2 × 2 px, got 1 × 1 px"):
        write_video(tmp_path / "a.mp4", [np.zeros((1, 1, 3), np.uint8)], 10.0)
    assert not list(tmp_path.iterdir())


def test_an_unfinished_run(ran, run_folder, tmp_path):
    pytest.importorskip("av")
    for path in sorted((tmp_path / "run" / "omnicam").glob("*.png"))[3:]:
        path.unlink()
    out, error = ran("plot", "run")
    assert f"3 of {run_folder} steps" in out
    assert "omnicam/000003.png: is missing: " in error
    assert f"the {run_folder - 3} steps with missing files\n" in error
    out, error = ran("video", "run", "-o", "run.mp4")
    assert "run.mp4: 3 images" in out
    assert error == (
        f"note: run/omnicam/000003.png: is missing: only the first 3 of {run_folder} steps are "
        f"used; record the run again to complete the {run_folder - 3} steps with missing files\n"
    )
    assert f"{run_folder} steps, 3 of them recorded before" in ran(*DRIVE, "-o", "run")[0]


@pytest.mark.parametrize("name", ["ground_truth.tum", "odometry.csv"])
def test_a_run_with_truncated_records(ran, refused, run_folder, tmp_path, name):
    path = tmp_path / "run" / name
    whole = path.read_text()
    path.write_text("".join(whole.splitlines(keepends=True)[:4]))
    line = refused("plot", "run")
    assert line.startswith(f"run/{name}: has ")
    assert line.endswith(": delete it, and record the run again to have it back")
    path.unlink()
    ran(*DRIVE, "-o", "run")
    assert path.read_text() == whole


def test_a_missing_scene_costs_the_map_only(ran, run_folder, tmp_path):
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    manifest["scene"]["file"] = "gone.glb"
    (tmp_path / "run" / "manifest.json").write_text(json.dumps(manifest))
    _, error = ran("plot", "run")
    assert error.startswith("note: plotted without a map: gone.glb: no such scene file")


def test_a_scene_is_the_same_from_any_folder(ran, quiet, needs_opengl, tmp_path, monkeypatch):
    shutil.copy(SCENES / "compass" / "compass.glb", tmp_path / "room.glb")
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    options = ["--robot", "superscout", "--size", "16"]
    quiet("drive", "room.glb", "--path", "way.csv", *options, "-o", "run")
    before = {path: path.read_bytes() for path in (tmp_path / "run").rglob("*.*")}
    monkeypatch.chdir("run")
    out = quiet("drive", "../room.glb", "--path", "../way.csv", *options, "-o", ".")
    assert "4 steps, 4 of them recorded before" in out
    assert {path: path.read_bytes() for path in (tmp_path / "run").rglob("*.*")} == before
    quiet("plot", ".")
    shutil.copy(SCENES / "rings" / "rings.glb", tmp_path / "room.glb")
    _, error = ran("plot", ".")
    assert error == f"note: {tmp_path}/room.glb: has changed since the run\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plot", "run", "-o", "a.bmp"], "a.bmp: expected .png"),
        (["video", "run", "-o", "a.avi"], "a.avi: expected .mp4 or .mkv, got .avi"),
        (["video", "run", "-o", "a.mp4", "--camera-name", "omni"], "did you mean 'omnicam'?"),
    ],
)
def test_bad_views_get_one_line(refused, run_folder, arguments, message):
    assert message in refused(*arguments)


def test_a_missing_extra_is_named(refused, monkeypatch):
    monkeypatch.setattr("omnisim.core.extras.is_installed", lambda module: False)
    line = refused("export", "run", "--to", "ros2-mcap", "-o", "out")
    assert line == "--to ros2-mcap needs rosbags: pip install 'omnisim-camera[ros]'"


def test_options_of_an_export_reach_its_settings(ran, monkeypatch, tmp_path):
    found = []

    def exported(run, form, output, settings, *others):
        found.append(settings)
        yield 0

    monkeypatch.setattr("omnisim.apps.cli.runs.export.export_run", exported)
    (tmp_path / "run").mkdir()
    command = ("export", "run", "--to", "ros2-mcap", "-o", "bag")
    ran(*command)
    ran(*command, "--start-time", "2", "--compressed")
    ran(*command, "--points", "--cloud-layout", "ouster-u8", "--no-map")
    assert found == [
        ExportSettings(),
        ExportSettings(2_000_000_000, compressed=True),
        ExportSettings(with_points=True, cloud_layout="ouster-u8", with_map=False),
    ]


def test_steps_without_a_file_are_not_there_before(ran, tmp_path):
    """A camera of 1 Hz leaves most steps without an image."""
    (tmp_path / "robot.toml").write_text(
        'name = "cart"\n[[sensors]]\nname = "front"\ntype = "omnicamera"\nrate_hz = 1.0\n'
        "position_m = [0.0, 0.0, 0.5]\n"
    )
    (tmp_path / "path.csv").write_text(
        "t_s,x_m,y_m,yaw_deg\n" + "".join(f"{0.25 * n},{0.1 * n},0,0\n" for n in range(6))
    )
    drive = ("drive", "compass", "--robot", "robot.toml", "--path", "path.csv", "--size", "16")
    assert "run: 6 steps; " in ran(*drive, "-o", "run")[0]
    assert "run: 6 steps, 6 of them recorded before; " in ran(*drive, "-o", "run")[0]


def test_contacts_are_noted_and_refused(ran, refused, needs_opengl, tmp_path):
    """One note per object and a count at the end; --no-contact writes nothing."""
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n2.9,0\n")
    drive = ["drive", "soccer", "--robot", "superscout", "--path", "way.csv", "--step", "1.5"]
    drive += ["--size", "16", "--quality", "fast"]
    line = refused(*drive, "--no-contact", "-o", "run")
    assert "way.csv: contact with goal_blue first at step " in line
    out, error = ran(*drive, "-o", "run")
    assert error.startswith("note: contact with goal_blue first at step ")
    assert "; contact with 1 object\n" in out
    path = json.loads((tmp_path / "run" / "manifest.json").read_text())["path"]
    assert path["follows_floor"]
    assert [contact["object"] for contact in path["contacts"]] == ["goal_blue"]
