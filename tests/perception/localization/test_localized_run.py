"""A short drive from its images to the page, by the command line."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

from omnisim.apps.cli.app import app
from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image, write_image
from omnisim.core.trajectories import read_trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimators.landmark_localization import LandmarkLocalization
from omnisim.perception.landmarks.color_model import Costs, load_model
from omnisim.perception.landmarks.landmark_detector import LandmarkDetector
from omnisim.perception.localization.filter import LandmarkMap, read_parameters
from omnisim.perception.localization.track import (
    localize,
    notices,
    observation_from_detection,
    write_track,
)
from omnisim.report import localization_report
from omnisim.runs.run_data import RunLabels, landmark_colors, read_run, train_on_run
from omnisim.sensors import calibration_file

STEPS = 5


def _omnisim(*words):
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=True)


def _done(*words):
    """Output of a command that succeeds, in one line."""
    done = _omnisim(*words)
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split())


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A meter and a half across the middle of the field, with labels."""
    folder = tmp_path_factory.mktemp("localized")
    (folder / "way.csv").write_text("x_m,y_m\n-1.0,0.2\n0.6,0.2\n")
    words = ("--path", folder / "way.csv", "--step", 0.4, "--quality", "fast", "--also", "instance")
    _done("drive", "soccer", "--robot", "p2at", *words, "-o", folder / "run")
    return folder / "run"


@pytest.fixture(scope="module")
def model(run):
    """Colors that were learned from it."""
    said = _done("landmarks", "train", run, "-o", run.parent / "model.npz")
    assert "3 colors from 5 images" in said
    return run.parent / "model.npz"


@pytest.fixture(scope="module")
def localized(run, model):
    """It, localized."""
    _done("localize", run, "-o", run.parent / "out", "--model", model)
    return run.parent / "out"


def test_labels_are_those_of_the_colors(run):
    data = read_run(run)
    colors = landmark_colors(data.landmarks)
    assert colors == ("pink", "sky_blue", "yellow")  # white tells nothing
    labels, image = RunLabels(data, colors)(0), data.image(0)
    assert labels.shape == image.shape[:2]
    for index, hue in enumerate(((244, 56, 162), (0, 184, 241), (246, 218, 0)), start=1):
        mean = np.median(image[labels == index], axis=0)
        # the lamps' shade takes from all three alike; the hue is left
        assert np.linalg.norm(mean / mean.max() - np.array(hue) / max(hue)) < 0.2


def test_landmarks_are_detected_in_a_run_and_in_a_image(run, model, tmp_path):
    csv, png = tmp_path / "found.csv", tmp_path / "found.png"
    _done("landmarks", "detect", run, "--model", model, "-o", csv, "--show", png)
    lines = csv.read_text().splitlines()
    assert len(lines) > 1 + 4 * STEPS
    assert png.stat().st_size > 10_000
    image = run / "omnicam" / "000002.png"
    done = _omnisim("landmarks", "detect", image, "--model", model)
    assert done.exit_code == 0, done.output
    alone = {line.split(":")[0].strip() for line in done.output.splitlines()[1:]}
    assert alone == {line.split(",")[1] for line in lines if line.startswith("2,")}


def test_a_run_is_localized(run, localized):
    out = localized
    assert {path.name for path in out.iterdir()} == {
        "estimate.tum", "estimate.csv", "measurements.csv", "detections.csv", "report.html",
        "report.json", "fig11-detections.png", "fig12-paths.png", "fig13-errors.png",
    }  # fmt: skip
    (section,) = json.loads((out / "report.json").read_text())["sections"]
    values = {measure["name"]: measure["value"] for measure in section["measures"]}
    assert values["landmarks accepted by the gate"] >= 4 * (STEPS - 1)
    truth = np.loadtxt(run / "ground_truth.tum")
    estimate = np.loadtxt(out / "estimate.tum")
    # the bound of experiment 1
    assert np.linalg.norm(estimate[:, 1:3] - truth[:, 1:3], axis=1).max() < 0.25
    rows = np.genfromtxt(out / "estimate.csv", delimiter=",", names=True)
    upper = ["xx_m2", "xy_m2", "x_yaw_m_rad", "yy_m2", "y_yaw_m_rad", "yaw_yaw_rad2"]
    matrices = np.stack([rows[name] for name in upper])[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    assert np.linalg.eigvalsh(np.moveaxis(matrices, -1, 0)).min() > 0.0


def test_a_run_without_ground_truth_is_localized_without_errors(run, model, tmp_path, monkeypatch):
    monkeypatch.setattr(localization_report, "detections_figure", lambda shown: Figure())
    shutil.copytree(run, tmp_path / "blind")
    (tmp_path / "blind" / "ground_truth.tum").unlink()
    said = _done("localize", tmp_path / "blind", "-o", tmp_path / "out", "--model", model)
    assert "no ground truth" in said
    assert not (tmp_path / "out" / "fig13-errors.png").exists()
    section = json.loads((tmp_path / "out" / "report.json").read_text())["sections"][0]
    assert not any("error" in measure["name"] for measure in section["measures"])


def _track(folder, model):
    """Estimate of `omnisim localize`, without its report."""
    data, parameters = read_run(folder), read_parameters()
    colors, landmarks = load_model(model)
    detector = LandmarkDetector(colors, landmarks, data.mount)
    observations = [
        [observation_from_detection(each, parameters.measurement) for each in detector(image)]
        for image in data.images()
    ]
    known = LandmarkMap.of_scene(data.landmarks)
    return localize(data.odometry, observations, known, parameters, data.mount.position_m)


def test_the_estimator_of_evaluations_is_the_same_filter(run, localized, tmp_path):
    """Also with colors from the run itself, as `model` has them."""
    found = LandmarkLocalization().estimate(Recording.read(run), tmp_path)
    written = read_trajectory(localized / "estimate.tum")
    assert np.allclose(found.times_s, written.times_s, atol=1e-6)
    assert np.allclose(found.positions_m[:, :2], written.positions_m[:, :2], atol=1e-6)
    rotations = found.world_from_base[:, :3, :3]
    assert np.allclose(rotations, written.world_from_base[:, :3, :3], atol=1e-6)


def test_the_truth_is_not_looked_at(run, model, localized, tmp_path):
    """With a wrong truth beside them images and wheels lead to the same place."""
    shutil.copytree(run, tmp_path / "lied")
    moved = np.loadtxt(run / "ground_truth.tum") + 3.0 * np.eye(8)[1]
    np.savetxt(tmp_path / "lied" / "ground_truth.tum", moved)
    write_track(tmp_path, _track(tmp_path / "lied", model))
    for name in ("estimate.tum", "estimate.csv", "measurements.csv"):
        assert (tmp_path / name).read_bytes() == (localized / name).read_bytes()


def test_images_without_landmarks_leave_it_to_the_wheels(run, model, tmp_path):
    blank = shutil.copytree(run, tmp_path / "blank")
    for step in range(STEPS):
        pixels, metadata = read_image(blank / "omnicam" / f"{step:06d}.png")
        write_image(blank / "omnicam" / f"{step:06d}.png", np.full_like(pixels, 90), metadata)
    track = _track(blank, model)
    assert notices(track, read_parameters()) == ["4 of 4 steps show no landmark: 1, 2, 3, 4"]
    np.testing.assert_allclose(track.poses[:, :2], track.reckoned[:, :2], atol=1e-9)
    assert np.all(np.diff(np.trace(track.covariances, axis1=1, axis2=2)) > 0.0)


TRAIN, DETECT = ("landmarks", "train", "RUN", "-o"), ("landmarks", "detect")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("localize", "RUN", "-o", "OUT", "--model", "RUN"), "got the folder"),
        (("localize", "RUN", "-o", "OUT", "--model", "OUT.npz"), "No such file"),
        (("localize", "OUT", "-o", "OUT2"), "no such folder"),
        ((*TRAIN, "OUT.txt"), "expected a name that ends in .npz"),
        ((*TRAIN, "OUT.npz", "--missed", "-1"), "--missed: expected a number above 0"),
        ((*TRAIN, "OUT.npz", "--camera-name", "omni"), "'omnicam'?"),
        ((*TRAIN, "OUT.npz", "--missed", "1e300"), "≤ 1e+09"),
        ((*DETECT, "RUN", "--model", "MODEL", "-o", "MODEL"), "ends in .csv"),
        ((*DETECT, "PNG", "--model", "MODEL", "--camera-name", "omnicam"), "expected a run"),
        ((*DETECT, "RUN", "--model", "MODEL", "--sensor", "PNG"), "--sensor: expected an image"),
    ],
)
def test_bad_input_is_one_line(run, model, tmp_path, words, message):
    places = {"RUN": run, "MODEL": model, "PNG": run / "omnicam" / "000001.png"}
    places |= {"OUT": tmp_path / "out", "OUT2": tmp_path / "out2"}
    places |= {f"OUT{suffix}": tmp_path / f"out{suffix}" for suffix in (".npz", ".txt")}
    done = _omnisim(*(places.get(word, word) for word in words))
    assert isinstance(done.exception, OmnisimError)
    assert message in str(done.exception)
    assert "\n" not in str(done.exception)
    assert list(tmp_path.iterdir()) == []


def test_a_run_without_labels_teaches_nothing(run, tmp_path):
    plain = shutil.copytree(run, tmp_path / "plain")
    manifest = json.loads((plain / "manifest.json").read_text())
    (plain / "manifest.json").write_text(json.dumps(manifest | {"channels": []}))
    with pytest.raises(OmnisimError, match="has no labels to learn from: drive it again"):
        train_on_run(read_run(plain), Costs())


@pytest.mark.parametrize("number", ["1e999", "-1", "1.5", "99999999999999999999"])
def test_labels_with_other_ids_are_damaged(run, tmp_path, number):
    copy = shutil.copytree(run, tmp_path / "copy")
    table = json.loads((copy / "labels.json").read_text())
    table["instances"][0]["id"] = "NUMBER"
    (copy / "labels.json").write_text(json.dumps(table).replace('"NUMBER"', number))
    with pytest.raises(OmnisimError, match=r"labels\.json: is damaged: not a table of labels"):
        train_on_run(read_run(copy), Costs())


def test_a_image_without_its_camera_is_taken_by_a_sensor_file(run, model, tmp_path):
    pixels, _ = read_image(run / "omnicam" / "000001.png")
    write_image(tmp_path / "plain.png", pixels, None)
    words = ("landmarks", "detect", tmp_path / "plain.png", "--model", model)
    assert "pass the sensor file" in str(_omnisim(*words).exception)
    found, own = (
        [line for line in _omnisim(*parts).output.splitlines() if " m, " in line]
        for parts in (
            (*words, "--sensor", run / "omnicam" / "sensor.toml"),
            ("landmarks", "detect", run / "omnicam" / "000001.png", "--model", model),
        )
    )
    assert found == own
    assert len(found) >= 4


def test_a_run_with_a_image_missing_says_which(run, model, tmp_path):
    broken = shutil.copytree(run, tmp_path / "broken")
    (broken / "omnicam" / "000003.png").unlink()
    message = "000003.png: is missing: only the first 3 of 5 steps are used; record the run again"
    assert message in _done("landmarks", "detect", broken, "--model", model).replace("- ", "-")


def test_a_image_of_another_camera_is_named(run, monkeypatch):
    data = read_run(run)
    stored = read_image(run / "omnicam" / "000002.png")[0]
    for spoiled, message in (
        (stored[::2, ::2], "180 × 180 px of 3 × uint8"),
        (stored[..., :1], "px of 1 × uint8"),
        (stored.astype(np.uint16) * 257, "px of 3 × uint16"),
    ):
        monkeypatch.setattr(calibration_file, "read_image", lambda _, s=spoiled: (s, None))
        with pytest.raises(OmnisimError, match=rf"000002.png: has .*{message}.* 3 × uint8"):
            data.image(2)


def test_landmarks_that_the_model_cannot_tell_are_named(run, model):
    data = read_run(run)
    colors, landmarks = load_model(model)
    renamed = dataclasses.replace(colors, colors=("pink", "green", "yellow"))
    detector = LandmarkDetector(renamed, landmarks, data.mount)
    assert detector.ignored == ("goal_blue", "beacon_left_blue", "beacon_right_blue")
    assert LandmarkDetector(colors, landmarks, data.mount).ignored == ()
