"""`omnisim drive`, `plot` and `video`: output, files and errors."""

import json
import re
import shutil

import numpy as np
import pytest

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_image
from omnisim.core.package_files import SCENES
from omnisim.plots.video_file import write_video
from omnisim.rendering.opengl import cube_backend

ROUTE = ["--size", "32", "--step", "2", "--turn-step", "90"]
DRIVE = ["drive", "soccer", "--robot", "superscout", "--path", "lap_clockwise", *ROUTE]


@pytest.fixture(scope="module")
def whole_run():
    """Folder of the drive by its name, once a test has made it."""
    return {}


@pytest.fixture
def run_folder(omnisim, needs_opengl, whole_run, tmp_path, tmp_path_factory):
    """Copy of a run that is driven once."""
    if not whole_run:
        status, out, error = omnisim(*DRIVE, "-o", "run")
        assert (status, error) == (0, "")
        assert "run: " in out
        whole_run["run"] = tmp_path_factory.mktemp("drive") / "run"
        (tmp_path / "run").rename(whole_run["run"])
    shutil.copytree(whole_run["run"], tmp_path / "run")
    return "run"


def test_a_drive_by_rays_opens_no_opengl(omnisim, tmp_path, monkeypatch):
    pytest.importorskip("embreex")
    monkeypatch.setattr(cube_backend, "open_context", None)
    (tmp_path / "path.csv").write_text("x_m,y_m\n0,0\n0.4,0\n")
    drive = ["drive", "soccer", "--robot", "superscout", "--path", "path.csv", "--size", "32"]
    rays = [*drive, "--quality", "fast", "--also", "range", "--backend", "rays", "-o", "run"]
    status, _, error = omnisim(*rays)
    assert (status, error) == (0, "")
    image = tmp_path / "run" / "omnicam" / "000000.png"
    before = image.read_bytes()
    assert read_image(image)[0].std() > 20
    image.unlink()
    status, _, _ = omnisim(*rays)  # goes on
    assert status == 0
    assert image.read_bytes() == before
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["renderer"].startswith("embreex ")
    status, _, error = omnisim(*drive, "--backend", "rays", "--device", "0", "-o", "other")
    assert (status, error) == (1, "error: --device: expected --backend cube, got --backend rays\n")


def test_a_robot_without_sensors_says_so(omnisim, needs_opengl, tmp_path):
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    (tmp_path / "bare.toml").write_text(
        'name = "bare"\n[kinematics]\ntype = "differential"\nmax_speed_mps = 1.0\n'
        "max_turn_rate_degps = 90.0\nmax_acceleration_mps2 = 0.5\n"
        "max_turn_acceleration_degps2 = 90.0\n"
    )
    drive = ["drive", "compass", "--robot", "bare.toml", "--path", "way.csv", "-o", "run"]
    status, out, error = omnisim(*drive)
    assert status == 0
    assert "there before" not in out
    assert (
        "note: bare has no sensors: only its path and odometry are recorded: add [[sensors]] to "
        "its robot file\n"
    ) in error


@pytest.mark.slow
def test_drive_plot_and_video(omnisim, run_folder, tmp_path):
    status, out, error = omnisim(*DRIVE, "-o", "run")
    assert (status, error) == (0, "")
    steps = json.loads((tmp_path / "run" / "manifest.json").read_text())["steps"]
    assert f"run: {steps} steps, {steps} of them there before; " in out
    assert re.search(r" s; omnicam: \d+ polygons \(auto\)\n", out)
    status, out, error = omnisim("plot", "run")
    assert (status, error) == (0, "")
    assert f"run/plot.png: {steps} of {steps} steps" in out
    pixels, _ = read_image(tmp_path / "run" / "plot.png")
    assert pixels.std() > 20
    status, out, error = omnisim("plot", "run", "-o", "plot.svg", "--scene", "soccer")
    assert (status, error) == (0, "")
    assert "<svg" in (tmp_path / "plot.svg").read_text()
    pytest.importorskip("av")
    status, out, error = omnisim("video", "run", "-o", "run.mp4", "--fps", "5")
    assert (status, error) == (0, "")
    assert f"run.mp4: {steps} images, {steps / 5:.1f} s" in out


def test_the_video_shows_the_images(omnisim, run_folder, tmp_path):
    av = pytest.importorskip("av")
    omnisim("video", "run", "-o", "run.mp4")
    with av.open(str(tmp_path / "run.mp4")) as video:
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    steps = json.loads((tmp_path / "run" / "manifest.json").read_text())["steps"]
    assert len(frames) == steps
    for step in (0, steps - 1):
        pixels, _ = read_image(tmp_path / "run" / "omnicam" / f"{step:06d}.png")
        # colors are coded at half the resolution: compare what is left of 8 × 8 blocks
        one, other = (p.reshape(4, 8, 4, 8, 3).mean(axis=(1, 3)) for p in (pixels, frames[step]))
        assert abs(one - other).mean() < 8.0


def test_robots_that_drove_together_are_plotted_and_seen_side_by_side(
    omnisim, run_folder, tmp_path
):
    av = pytest.importorskip("av")
    (tmp_path / "pair").mkdir()
    shutil.copytree(tmp_path / "run", tmp_path / "pair" / "a")
    (tmp_path / "run").rename(tmp_path / "pair" / "b")
    (tmp_path / "pair" / "b" / "omnicam" / "000002.png").unlink()
    steps = json.loads((tmp_path / "pair" / "a" / "manifest.json").read_text())["steps"]
    status, out, error = omnisim("plot", "pair")
    assert status == 0
    assert f"pair/plot.png: {steps} of {steps} steps, 2 of {steps} steps" in out
    assert error.startswith("note: pair/b/omnicam/000002.png: is missing")
    status, out, _ = omnisim("video", "pair", "-o", "pair.mp4")
    assert status == 0
    assert f"pair.mp4: {steps} images" in out
    with av.open(str(tmp_path / "pair.mp4")) as video:
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    for step, right in ((0, 0), (steps - 1, 1)):  # the right one has two images
        files = (("a", step), ("b", right))
        pixels = [read_image(tmp_path / "pair" / name / "omnicam" / f"{index:06d}.png")[0]
                  for name, index in files]  # fmt: skip
        expected = np.concatenate(pixels, axis=1)
        assert frames[step].shape == expected.shape
        one, other = (p.reshape(4, 8, 8, 8, 3).mean(axis=(1, 3)) for p in (expected, frames[step]))
        assert abs(one - other).mean() < 8.0


def test_images_too_small_for_a_video(tmp_path):
    pytest.importorskip("av")
    with pytest.raises(OutputError, match=r"at least 2 × 2 px, got 1 × 1 px"):
        write_video(tmp_path / "a.mp4", [np.zeros((1, 1, 3), np.uint8)], 10.0)
    assert not list(tmp_path.iterdir())


def test_an_unfinished_run(omnisim, run_folder, tmp_path):
    for path in sorted((tmp_path / "run" / "omnicam").glob("*.png"))[3:]:
        path.unlink()
    steps = json.loads((tmp_path / "run" / "manifest.json").read_text())["steps"]
    status, out, error = omnisim("plot", "run")
    assert status == 0
    assert f"3 of {steps} steps" in out
    assert "omnicam/000003.png: is missing: " in error
    assert f"the others, {steps - 3} without all their files\n" in error
    status, out, _ = omnisim(*DRIVE, "-o", "run")
    assert f"{steps} steps, 3 of them there before" in out


def test_a_gap_in_a_video_is_said(omnisim, run_folder, tmp_path):
    pytest.importorskip("av")
    (tmp_path / "run" / "omnicam" / "000002.png").unlink()
    steps = json.loads((tmp_path / "run" / "manifest.json").read_text())["steps"]
    status, out, error = omnisim("video", "run", "-o", "run.mp4")
    assert status == 0
    assert "run.mp4: 2 images" in out
    assert error == (
        f"note: run/omnicam/000002.png: is missing: the first 2 of {steps} steps are looked at; "
        "record the run again to have the others, 1 without all their files\n"
    )


@pytest.mark.parametrize("name", ["ground_truth.tum", "odometry.csv"])
def test_a_run_with_truncated_records(omnisim, run_folder, tmp_path, name):
    path = tmp_path / "run" / name
    whole = path.read_text()
    path.write_text("".join(whole.splitlines(keepends=True)[:4]))
    status, _, error = omnisim("plot", "run")
    assert status == 1
    assert error.startswith(f"error: run/{name}: has ")
    assert error.endswith(": delete it, and record the run again to have it back\n")
    path.unlink()
    assert omnisim(*DRIVE, "-o", "run")[0] == 0
    assert path.read_text() == whole


def test_a_missing_scene_costs_the_map_only(omnisim, run_folder, tmp_path):
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    manifest["scene"]["file"] = "gone.glb"
    (tmp_path / "run" / "manifest.json").write_text(json.dumps(manifest))
    status, _, error = omnisim("plot", "run")
    assert status == 0
    assert error.startswith("note: plotted without a map: gone.glb: no such scene file")


def test_a_scene_is_the_same_from_any_folder(omnisim, needs_opengl, tmp_path, monkeypatch):
    shutil.copy(SCENES / "compass" / "compass.glb", tmp_path / "room.glb")
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    options = ["--robot", "superscout", "--size", "16"]
    status, _, error = omnisim("drive", "room.glb", "--path", "way.csv", *options, "-o", "run")
    assert (status, error) == (0, "")
    before = {path: path.read_bytes() for path in (tmp_path / "run").rglob("*.*")}
    monkeypatch.chdir("run")
    status, out, error = omnisim(
        "drive", "../room.glb", "--path", "../way.csv", *options, "-o", "."
    )
    assert (status, error) == (0, "")
    assert "4 steps, 4 of them there before" in out

    assert {path: path.read_bytes() for path in (tmp_path / "run").rglob("*.*")} == before
    status, _, error = omnisim("plot", ".")
    assert (status, error) == (0, "")
    shutil.copy(SCENES / "rings" / "rings.glb", tmp_path / "room.glb")
    status, _, error = omnisim("plot", ".")
    assert (status, error) == (0, f"note: {tmp_path}/room.glb: has changed since the run\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plot", "none"], "none: no such folder: expected the folder of a run"),
        (["plot", "run", "-o", "a.bmp"], "a.bmp: expected .png"),
        (["video", "run", "-o", "a.avi"], "a.avi: expected .mp4 or .mkv, got .avi"),
        (["video", "run", "-o", "a.mp4", "--camera-name", "omni"], "did you mean 'omnicam'?"),
        (["video", "none", "-o", "a.mp4"], "none: no such folder"),
    ],
)
def test_bad_views_get_one_line(omnisim, run_folder, tmp_path, arguments, message):
    status, _, error = omnisim(*arguments)
    assert status == 1
    assert error.startswith("error: ")
    assert message in error
    assert error.count("\n") == 1
    assert not list(tmp_path.glob("a.*"))


def test_steps_without_a_file_are_not_there_before(omnisim, tmp_path):
    """A camera of 1 Hz leaves most steps without an image."""
    (tmp_path / "robot.toml").write_text(
        'name = "cart"\n[[sensors]]\nname = "front"\ntype = "omnicamera"\nrate_hz = 1.0\n'
        "position_m = [0.0, 0.0, 0.5]\n"
    )
    (tmp_path / "path.csv").write_text(
        "t_s,x_m,y_m,yaw_deg\n" + "".join(f"{0.25 * n},{0.1 * n},0,0\n" for n in range(6))
    )
    drive = ("drive", "soccer", "--robot", "robot.toml", "--path", "path.csv", "--size", "16")
    status, out, error = omnisim(*drive, "-o", "run")
    assert status == 0, error
    assert "run: 6 steps; " in out
    assert "run: 6 steps, 6 of them there before; " in omnisim(*drive, "-o", "run")[1]


def test_contacts_are_noted_and_refused(omnisim, needs_opengl, tmp_path):
    """One note per object and a count at the end; --no-contact writes nothing."""
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n2.9,0\n")
    drive = ["drive", "soccer", "--robot", "superscout", "--path", "way.csv", "--step", "1.5"]
    drive += ["--size", "32", "--quality", "fast"]
    status, out, error = omnisim(*drive, "--no-contact", "-o", "run")
    assert status == 1
    assert error.count("\n") == 1
    assert "way.csv: contact with goal_blue first at step " in error
    assert not (tmp_path / "run").exists()
    status, out, error = omnisim(*drive, "-o", "run")
    assert status == 0
    assert error.startswith("note: contact with goal_blue first at step ")
    assert "; contact with 1 object\n" in out
    path = json.loads((tmp_path / "run" / "manifest.json").read_text())["path"]
    assert path["follows_floor"]
    assert [contact["object"] for contact in path["contacts"]] == ["goal_blue"]
    status, out, error = omnisim(*drive, "--ground", "0", "-o", "run")  # not off the carpet
    assert status == 1
    assert "run/manifest.json: path.route was " in error
