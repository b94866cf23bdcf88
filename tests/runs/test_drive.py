"""Drives: what they leave on disk, killed at any moment and gone on with."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from omnisim.core.errors import GraphicsError, OutputError, RunError
from omnisim.core.files.image_files import read_image
from omnisim.core.trajectories import read_trajectory
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.renderer import RecordedFrame, Renderer
from omnisim.robots import read_odometry
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.runs.run_folder import RunFolder
from omnisim.scene import load_scene

pytestmark = pytest.mark.usefixtures("needs_opengl")
ROUTE = Route("lap", step_m=2.0, step_deg=90.0)
ARGUMENTS = ["drive", "soccer", "--robot", "p2at", "--path", "lap", "--size", "48"]
ARGUMENTS += ["--step", "1.2", "--turn-step", "45"]


@pytest.fixture(scope="module")
def scene():
    return load_scene("soccer")


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle.load("p2at").with_cameras(size_px=48)


def _record(drive, folder, force=False):
    """Record all; returns the steps that were there before, and at the end."""
    steps = list(drive.plan().record(folder, force))
    return steps[0], steps[-1]


def _bytes(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _ranges(folder, step):
    lines = (folder / "lms200" / f"{step:06d}.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines if not line.startswith("#")]
    assert rows[0] == ["beam", "angle_deg", "range_m"]
    return np.array([float(row[2]) for row in rows[1:]])


@pytest.fixture(scope="module")
def whole(scene, vehicle, tmp_path_factory):
    """A run that was never interrupted."""
    folder = tmp_path_factory.mktemp("runs") / "whole"
    _record(Drive(scene, vehicle, ROUTE, seed=7), folder)
    return folder


def test_everything_is_there(whole, vehicle):
    manifest = json.loads((whole / "manifest.json").read_text())
    steps = manifest["steps"]
    assert manifest["seed"] == 7
    assert manifest["libraries"]["numpy"] == np.__version__
    truth = read_trajectory(whole / "ground_truth.tum")
    assert len(truth) == steps
    odometry = read_odometry(whole / "odometry.csv")
    assert len(odometry.times_s) == steps
    sensor = OmniCamera.from_file(whole / "omnicam" / "sensor.toml")
    assert sensor.model == vehicle.camera("omnicam").sensor.model
    calibration = json.loads((whole / "omnicam" / "calibration.json").read_text())
    assert calibration["camera"]["xi"] == pytest.approx(0.9954942)
    mount = np.array(calibration["base_from_optical"])
    for step in (0, steps - 1):
        pixels, metadata = read_image(whole / "omnicam" / f"{step:06d}.png")
        assert pixels.shape == (48, 48, 3)
        base, optical = (np.array(metadata[f"world_from_{name}"]) for name in ("base", "optical"))
        np.testing.assert_allclose(base, truth.world_from_base[step], atol=1e-8)  # nine decimals
        np.testing.assert_allclose(optical, base @ mount, atol=1e-12)
        assert len(_ranges(whole, step)) == 361
    assert not list(whole.rglob(".omnisim-*"))


def test_the_robot_sees_itself_and_its_laser_does_not(whole):
    """The blue of the LMS200's housing is in the middle of the image, towards the top."""
    pixels, _ = read_image(whole / "omnicam" / "000000.png")
    front, behind = pixels[14:22, 21:27].mean(axis=(0, 1)), pixels[26:32, 21:27].mean(axis=(0, 1))
    assert front[2] > 1.5 * front[0]
    assert behind[2] < 1.3 * behind[0]
    # nothing of the robot stands in the beams
    assert _ranges(whole, 0).min() > 0.3


def test_another_seed_is_another_odometry_and_the_same_images(scene, vehicle, whole, tmp_path):
    drive = Drive(scene, vehicle, ROUTE, seed=8)
    steps = drive.plan().record(tmp_path / "run")
    for _ in range(3):
        next(steps)
    steps.close()
    other = _bytes(tmp_path / "run")
    same = _bytes(whole)
    assert other["odometry.csv"] != same["odometry.csv"]
    assert other["ground_truth.tum"] == same["ground_truth.tum"]
    assert other["omnicam/000001.png"] == same["omnicam/000001.png"]
    assert other["lms200/000001.csv"] == same["lms200/000001.csv"]


def test_a_finished_run_stays_as_it_is(scene, vehicle, whole):
    before = {path: path.stat().st_mtime_ns for path in whole.rglob("*")}
    there, done = _record(Drive(scene, vehicle, ROUTE, seed=7), whole)
    assert there == done == json.loads((whole / "manifest.json").read_text())["steps"]
    assert {path: path.stat().st_mtime_ns for path in whole.rglob("*")} == before


@pytest.mark.slow
def test_another_run_is_refused_and_nothing_lost(scene, vehicle, whole):
    before = _bytes(whole)
    others = {
        "seed was 7, is 8": Drive(scene, vehicle, ROUTE, seed=8),
        r"path\.route was": Drive(scene, vehicle, Route("lap", step_m=0.9, step_deg=90.0), seed=7),
        r"robot\.contents was": Drive(scene, vehicle.with_cameras(size_px=64), ROUTE, seed=7),
        r"sensors\.omnicam\.quality\.supersampling was 3, is 2": Drive(
            scene, vehicle.with_cameras(quality="fast"), ROUTE, seed=7
        ),
        "unlit was False, is True": Drive(scene, vehicle, ROUTE, seed=7, unlit=True),
    }
    for words, drive in others.items():
        with pytest.raises(RunError, match=f"{words}.*another run is in this folder") as info:
            next(drive.plan().record(whole))
        assert "\n" not in str(info.value)
    assert _bytes(whole) == before


def test_force_throws_the_other_run_away_and_nothing_else(scene, vehicle, whole, tmp_path):
    """Neither what a person has added, nor what a link leads to."""
    folder = tmp_path / "run"
    shutil.copytree(whole, folder)
    mine = [folder / "notes.txt", folder / "omnicam" / "sketch.txt"]
    for path in (*mine, folder / "plot.png"):
        path.write_text("mine")
    (folder / "omnicam").rename(tmp_path / "disk")
    (folder / "omnicam").symlink_to(tmp_path / "disk")
    before, other = _bytes(folder), Drive(scene, vehicle, ROUTE, seed=8)
    with pytest.raises(RunError, match="omnicam: is a link: --force removes no files elsewhere"):
        next(other.plan().record(folder, force=True))
    assert _bytes(folder) == before
    (folder / "omnicam").unlink()
    (tmp_path / "disk").rename(folder / "omnicam")
    steps = other.plan().record(folder, force=True)
    assert next(steps) == 0
    steps.close()
    assert [path.read_text() for path in mine] == ["mine", "mine"]
    assert json.loads((folder / "manifest.json").read_text())["seed"] == 8
    assert not list(folder.rglob("*.png"))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("notes.txt", "mine", "is not empty and has no manifest.json"),
        ("manifest.json", "{", "is damaged: not JSON"),
        ("manifest.json", "[]", "is damaged: not the manifest of a run"),
    ],
)
def test_foreign_folders_are_left_alone(scene, vehicle, tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    for force in (False, True):
        with pytest.raises(RunError, match=words):
            next(Drive(scene, vehicle, ROUTE).plan().record(tmp_path, force))
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize(
    ("keys", "value", "words"),
    [
        (["scene"], "soccer", r"scene: expected a table.*, got 'soccer'"),
        (["scene", "file"], None, "scene.file: expected text, got None"),
        (["steps"], -1, "steps: expected a number ≥ 1, got -1"),
        (["steps"], True, "steps: expected a whole number, got True"),
        (["sensors"], {"..": {"type": "lms200"}}, r"sensors\..*: expected letters.*, got '..'"),
        (["sensors", "omnicam", "type"], "sonar", "sensors.omnicam.type: unknown sensor type;"),
        (["format"], 1, "format: expected 2, got 1"),
    ],
)
def test_a_manifest_that_somebody_has_edited(whole, tmp_path, keys, value, words):
    manifest = json.loads((whole / "manifest.json").read_text())
    table = manifest
    for key in keys[:-1]:
        table = table[key]
    table[keys[-1]] = value
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(RunError, match=rf"manifest\.json: is damaged: {words}") as info:
        RunFolder.read(tmp_path)
    assert "\n" not in str(info.value)
    (tmp_path / "manifest.json").write_text("[" * 100_000)
    with pytest.raises(RunError, match="is damaged: not JSON"):
        RunFolder.read(tmp_path)


def test_places_that_are_none(scene, vehicle, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RunError, match="expected a folder, got a file"):
        next(Drive(scene, vehicle, ROUTE).plan().record(tmp_path / "file"))
    with pytest.raises(RunError, match="file"):
        next(Drive(scene, vehicle, ROUTE).plan().record(tmp_path / "file" / "run"))
    with pytest.raises(RunError, match="expected the folder of a run"):
        RunFolder.read(tmp_path)
    with pytest.raises(RunError, match="seed: expected a whole number"):
        Drive(scene, vehicle, ROUTE, seed=-1).plan()


def test_a_full_disk_is_one_line_and_the_run_goes_on_later(
    scene, vehicle, whole, tmp_path, monkeypatch
):
    """The disk fills up in the middle of an image."""
    written = []
    true_write = Path.write_bytes

    def write(self, data):
        written.append(self)
        if len(written) > 5:
            true_write(self, data[: len(data) // 2])
            raise OSError(28, os.strerror(28))
        return true_write(self, data)

    monkeypatch.setattr(Path, "write_bytes", write)
    with pytest.raises(OutputError, match="No space left on device"):
        _record(Drive(scene, vehicle, ROUTE, seed=7), tmp_path / "run")
    monkeypatch.undo()
    assert not list((tmp_path / "run").rglob(".omnisim-*"))
    there, _ = _record(Drive(scene, vehicle, ROUTE, seed=7), tmp_path / "run")
    assert there == 5
    assert _bytes(tmp_path / "run") == _bytes(whole)


def test_sensor_file_of_a_camera_is_that_camera(tmp_path):
    mounting = {"position_m": [0.1, -0.2, 0.3], "roll_deg": 4.0, "yaw_deg": -50.0}
    mirror = {"k": 5.0, "rim_radius_m": 0.03, "polygons": "exact", "mounting": mounting}
    camera = {"width_px": 320, "height_px": 240, "principal_point_px": [150.5, 120.25]}
    views = {"size_px": 300, "far_m": 70.0, "samples": 4}
    sensor = OmniCamera.from_table({"mirror": mirror, "virtual_cameras": views, "camera": camera})
    (tmp_path / "s.toml").write_text(sensor.to_toml())
    again = OmniCamera.from_file(tmp_path / "s.toml")
    own, model = again.model, sensor.model
    assert own.mirror.theta_max_rad == pytest.approx(model.mirror.theta_max_rad, abs=1e-12)
    np.testing.assert_allclose(again.base_from_rig, sensor.base_from_rig, atol=1e-12)
    for name in ("polygons", "face_size_px", "near_m", "far_m", "samples", "texels_per_pixel"):
        assert getattr(again, name) == getattr(sensor, name)
    assert own.focal_length_px == model.focal_length_px
    assert own.principal_point_px == model.principal_point_px


def test_missing_files_come_back_in_any_order(scene, vehicle, whole, tmp_path):
    """Deleted by hand, or left empty by a power cut."""
    folder = tmp_path / "run"
    shutil.copytree(whole, folder)
    (folder / "omnicam" / "000009.png").unlink()
    (folder / "omnicam" / "000002.png").write_bytes(b"")
    (folder / "lms200" / "000005.csv").unlink()
    (folder / "odometry.csv").write_bytes(b"")
    (folder / "omnicam" / "calibration.json").unlink()
    steps = json.loads((whole / "manifest.json").read_text())["steps"]
    drive = Drive(scene, vehicle, ROUTE, seed=7)
    assert list(drive.plan().record(folder)) == [steps - 3, steps - 2, steps - 1, steps]
    assert _bytes(folder) == _bytes(whole)


def test_one_drive_a_folder_at_a_time(scene, vehicle, tmp_path):
    drive = Drive(scene, vehicle, ROUTE, seed=7)
    first = drive.plan().record(tmp_path / "run")
    next(first)
    for force in (False, True):
        with pytest.raises(RunError, match="run: another command is writing to it: wait"):
            next(drive.plan().record(tmp_path / "run", force))
    next(first)
    first.close()
    second = drive.plan().record(tmp_path / "run")
    assert next(second) == 1
    second.close()


def test_a_step_is_written_while_the_next_is_drawn(scene, vehicle, whole, tmp_path, monkeypatch):
    """Counted steps have their files all the same, and the next step has none."""
    is_next_drawn = threading.Event()
    submit, save = Renderer.submit, RecordedFrame.save

    def submitted(renderer, *arguments, **options):
        pending = submit(renderer, *arguments, **options)
        if options["frame_number"] == 1:
            is_next_drawn.set()
        return pending

    def saved(reading, stem):
        assert is_next_drawn.wait(20.0)
        save(reading, stem)

    monkeypatch.setattr(Renderer, "submit", submitted)
    monkeypatch.setattr(RecordedFrame, "save", saved)
    steps = Drive(scene, vehicle, ROUTE, seed=7).plan().record(tmp_path / "run")
    assert [next(steps), next(steps)] == [0, 1]
    recorded = _bytes(tmp_path / "run")
    steps.close()
    assert _bytes(tmp_path / "run") == recorded
    names = {name for name in recorded if name.endswith((".png", "0.csv", "1.csv"))}
    assert names == {"omnicam/000000.png", "lms200/000000.csv"}
    assert all(recorded[name] == (whole / name).read_bytes() for name in names)


def test_what_cannot_be_drawn_leaves_no_folder(scene, vehicle, tmp_path):
    drive = Drive(scene, vehicle.with_cameras(size_px=30_000), ROUTE)
    with pytest.raises(GraphicsError, match="30000 × 30000 px"):
        next(drive.plan().record(tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_interrupted_by_a_person_it_says_how_to_go_on(tmp_path):
    # a job in the background of a shell inherits that interrupts are ignored
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "from omnisim.apps.cli.start import main; main()"
    command = [sys.executable, "-c", code, *ARGUMENTS]
    command[command.index("--step") + 1] = "0.1"
    process = subprocess.Popen(
        [*command, "-o", "run"], stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    while not (tmp_path / "run" / "omnicam" / "000002.png").exists():
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate()
    assert process.returncode == 130
    first, last = error.splitlines()
    assert re.fullmatch(r"run: \d+ of \d+ steps are done: run the same command to resume", first)
    assert last == "interrupted"
    assert not list((tmp_path / "run").rglob(".omnisim-*"))
