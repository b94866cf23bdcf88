"""Data sets on the command line: the same bytes, whatever happens in between."""

import json
import os
import pickle
import random
import shutil
import signal
import subprocess
import sys
import tarfile
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from omnisim.apps.cli.app import app
from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image
from omnisim.datasets.converted_datasets import CocoSettings
from omnisim.datasets.free_space import find_free_space
from omnisim.datasets.generate.generate import Generation
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.samples import Shards
from omnisim.datasets.generate.shard import find_shard
from omnisim.datasets.generate.workers import uninterrupted
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene import load_scene
from tests.datasets.plans import write_plan

MAIN = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from omnisim.apps.cli.start import main; main()"
)


def _omnisim(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def _tars(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.tar"))}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    plan = write_plan(folder, channels=["range", "instance"])
    done = _omnisim("generate", plan, "-o", folder / "out")
    assert done.exit_code == 0, done.output
    return plan, folder / "out"


def test_samples_are_whole(made):
    _, out = made
    with tarfile.open(out / "shard-000001.tar") as tar:
        names = tar.getnames()
        assert {member.mtime for member in tar.getmembers()} == {0}
    assert names == sorted(names)
    assert {name.partition(".")[0] for name in names} == {f"{n:09d}" for n in (3, 4, 5)}
    endings = {name.partition(".")[2] for name in names if name.startswith("000000003")}
    assert endings == {"png", "json", "channels.json", "range.png", "instance.png", "coco.json"}


def test_a_sample_is_the_image_at_its_pose(made):
    _, out = made
    sample = Shards(out)[4]
    pose = np.array(sample["metadata"]["images"]["camera"]["world_from_base"])
    camera = OmniCamera().resized(32).with_quality("fast")
    with open_sensor(load_scene("rings"), camera) as renderer:
        frame = renderer.render(pose, also=("range",))
    np.testing.assert_array_equal(sample["rgb"], frame.rgb)
    expected = np.where(np.isfinite(frame.channels["range"]), frame.channels["range"], np.inf)
    inside = np.asarray(frame.has_ray)
    np.testing.assert_allclose(sample["range"][inside], expected[inside], atol=1e-3)


def test_shards_that_are_there_stay(made):
    plan, out = made
    before = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    done = _omnisim("generate", plan, "-o", out)
    assert "2 shards, 2 of them made before" in done.output
    assert {path: path.stat().st_mtime_ns for path in out.iterdir()} == before


def test_parts_make_the_whole(made, tmp_path):
    plan, out = made
    for shards in ("1", "0:1"):
        done = _omnisim("generate", plan, "-o", tmp_path / "out", "--shards", shards)
        assert done.exit_code == 0
    assert _tars(tmp_path / "out") == _tars(out)
    manifests = [(folder / "manifest.json").read_text() for folder in (out, tmp_path / "out")]
    assert manifests[0] == manifests[1]


def test_a_damaged_shard_is_found_and_made_again(made, tmp_path):
    plan, out = made
    shutil.copytree(out, tmp_path / "out")
    tar = tmp_path / "out" / "shard-000001.tar"
    data = bytearray(tar.read_bytes())
    data[1000] ^= 1
    tar.write_bytes(data)
    done = _omnisim("dataset", "check", tmp_path / "out")
    assert "shard-000001.tar: is damaged: expected SHA-256" in str(done.exception)
    tar.write_bytes(data[:-512])
    assert find_shard(tmp_path / "out", 1) is None
    assert "1 of them made before" in _omnisim("generate", plan, "-o", tmp_path / "out").output
    assert _tars(tmp_path / "out") == _tars(out)
    assert _omnisim("dataset", "check", tmp_path / "out").exit_code == 0


def test_info_and_view(made, tmp_path):
    _, out = made
    done = _omnisim("dataset", "info", out)
    assert "samples      6 in 2 shards" in done.output
    content = json.loads(_omnisim("dataset", "info", out, "--json").output)
    assert content["channels"] == ["range", "instance"]
    assert _omnisim("dataset", "view", out, "-o", tmp_path / "view.png").exit_code == 0
    height, width, _ = read_image(tmp_path / "view.png")[0].shape  # three by two, with captions
    assert (height > 2 * 3 * 32, width > 3 * 32) == (True, True)
    card = (out / "README.md").read_text()
    assert "6 samples in 2 shards" in card
    assert "| rings | 6 |" in card


def test_the_card_counts_all_pixels(made):
    shards = pickle.loads(pickle.dumps(Shards(made[1])))  # as a worker of torch's has it
    finite = sum(np.isfinite(shards[row]["range"]).sum() for row in range(len(shards)))
    assert shards.manifest.statistics.ranges.total() == finite


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("generate", "PLAN"), "-o: missing: expected the folder of the data set"),
        (("generate", "PLAN", "-o", "NEW", "--shards", "2"), "--shards: expected a range in 0:2"),
        (("generate", "PLAN", "-o", "NEW", "--shards", "a"), "--shards: expected FROM:TO or"),
        (("generate", "PLAN", "-o", "NEW", "--shards", "1:1"), "expected FROM less than TO"),
        (("generate", "PLAN", "-o", "NEW", "--engine", "rya"), "got rya; did you mean"),
        (("generate", "PLAN", "-o", "NEW", "--address", "a"), "--address: requires --engine ray"),
        (("generate", "PLAN", "--check", "--estimate"), "expected one of them"),
        (("generate", "PLAN", "--preview", "4", "-o", "NEW"), "-o: expected a .png or .jpg"),
        (("generate", "PLAN", "--map", "-o", "NEW"), "expected .png, .pdf"),
        (("generate", "PLAN", "--map"), "-o: expected a .png, .pdf or .svg for the map"),
        (("generate", "OTHER", "-o", "OUT"), "belongs to another plan or other scenes"),
        (("generate", "PLAN", "-o", "FOLDER"), "is not a data set: expected a new folder"),
        (("generate", "no.toml", "-o", "NEW"), "no.toml: cannot be read"),
        (("dataset", "info", "FOLDER"), "manifest.json: cannot be read"),
        (("dataset", "view", "OUT", "-o", "NEW.png", "--first", "6"), "expected less than 6"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(made, tmp_path, words, message):
    plan, out = made
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "file").touch()
    other = write_plan(tmp_path, seed=9)
    places = {"PLAN": plan, "OUT": out, "NEW": tmp_path / "new", "OTHER": other}
    places |= {"FOLDER": tmp_path / "folder", "NEW.png": tmp_path / "new.png"}
    done = _omnisim(*(places.get(word, word) for word in words))
    assert isinstance(done.exception, OmnisimError)
    assert message in str(done.exception)
    assert "\n" not in str(done.exception)
    assert not (tmp_path / "new").exists() or not list((tmp_path / "new").glob("*.tar"))


def test_samples_that_see_nothing_are_drawn_again_or_refused(tmp_path):
    plan = write_plan(tmp_path, "[reject]\nnear_m = 1000.0\nmax_near_share = 0.5\nattempts = 3")
    done = _omnisim("generate", plan, "-o", tmp_path / "out")
    assert "sample 0: rejected 3 times, at last because " in str(done.exception)
    assert "of its rays hit within 1000 m (max_near_share)" in str(done.exception)
    assert not (tmp_path / "out").exists()


def test_a_plan_without_a_shard_has_no_claim_to_its_folder(tmp_path):
    out = tmp_path / "out"
    Generation(write_plan(tmp_path), out)  # and is killed
    again = Generation(write_plan(tmp_path, seed=9), out)
    assert again.prepared.fingerprint in (out / "plan.json").read_text()
    (out / "shard-000000.tar").touch()
    again.give_up()
    assert (out / "plan.json").is_file()
    with pytest.raises(OmnisimError, match="belongs to another plan"):
        Generation(write_plan(tmp_path, seed=8), out)
    (out / "shard-000000.tar").unlink()
    (out / "plan.json").write_text("{}")
    with pytest.raises(OmnisimError, match="belongs to"):
        Generation(write_plan(tmp_path, seed=8), out)


def test_estimate_and_preview(made, tmp_path):
    plan, _ = made
    assert "6 samples, " in _omnisim("generate", plan, "--estimate").output
    sheet = tmp_path / "sheet.png"
    assert _omnisim("generate", plan, "--preview", "4", "-o", sheet).exit_code == 0
    height, width, _ = read_image(sheet)[0].shape  # two by two, with captions
    assert (height > 2 * 3 * 32, width > 2 * 32) == (True, True)
    chart = tmp_path / "map.png"
    assert _omnisim("generate", plan, "--map", "-o", chart).exit_code == 0
    assert read_image(chart)[0].shape[2] >= 3
    assert "2 shards; plan" in _omnisim("generate", plan, "--check").output


def _started(plan, out, *words):
    command = [sys.executable, "-c", MAIN, "generate", str(plan), "-o", str(out), *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, start_new_session=True, **pipes)


def test_an_interrupt_waits_until_a_worker_has_started():
    done = []

    def start():
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            done.append("started")

    with pytest.raises(KeyboardInterrupt):
        start()
    assert done == ["started"]
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.slow
def test_killed_five_times_it_ends_with_the_same_bytes(tmp_path):
    plan = write_plan(tmp_path, scene="soccer", shards=30, images_per_shard=6)
    assert _omnisim("generate", plan, "-o", tmp_path / "whole").exit_code == 0
    moments, out, killed = random.Random(4), tmp_path / "out", 0
    for _ in range(5):
        process = _started(plan, out, "--workers", "2")
        time.sleep(moments.uniform(1.0, 6.0))
        how = moments.choice((signal.SIGKILL, signal.SIGINT, signal.SIGTERM))
        if process.poll() is None:
            # SIGKILL: the workers too, as an engine or a machine that goes down does
            os.killpg(process.pid, how) if how == signal.SIGKILL else process.send_signal(how)
            killed += 1
        _, errors = process.communicate(timeout=300)
        assert "Traceback" not in errors
    assert killed >= 2  # others were done before
    process = _started(plan, out)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert _tars(out) == _tars(tmp_path / "whole")


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(tmp_path):
    plan = write_plan(tmp_path, scene="soccer", shards=4, images_per_shard=8)
    assert _omnisim("generate", plan, "-o", tmp_path / "whole").exit_code == 0
    process = _started(plan, tmp_path / "out", "--workers", "2")
    children, victims = Path(f"/proc/{process.pid}/task/{process.pid}/children"), []
    while not victims and process.poll() is None:
        time.sleep(0.2)
        if list((tmp_path / "out").glob("*.tar")):
            numbers = children.read_text().split()
            commands = {int(n): Path(f"/proc/{n}/cmdline").read_bytes() for n in numbers}
            victims = [number for number, command in commands.items() if b"spawn_main" in command]
    assert victims
    os.kill(victims[0], signal.SIGKILL)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert _tars(tmp_path / "out") == _tars(tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.long
def test_ray_makes_the_same_bytes(made, tmp_path):
    pytest.importorskip("ray", reason="the extra ray is not installed")
    plan, out = made
    plan = os.path.relpath(plan)  # workers are in other folders
    process = _started(plan, os.path.relpath(tmp_path / "out"), "--engine", "ray")
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert _tars(tmp_path / "out") == _tars(out)
    assert (tmp_path / "out" / "manifest.json").is_file()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # leaves files open
def test_webdataset_reads_every_sample(made):
    webdataset = pytest.importorskip("webdataset", reason="webdataset is not installed")
    _, out = made
    tars = [str(path) for path in sorted(out.glob("*.tar"))]
    samples = list(webdataset.WebDataset(tars, shardshuffle=False).decode("rgb8"))
    assert [one["__key__"] for one in samples] == [f"{n:09d}" for n in range(6)]
    shards = Shards(out)
    for row, sample in enumerate(samples):
        np.testing.assert_array_equal(sample["png"], shards[row]["rgb"])
        assert sample["json"]["number"] == row


@pytest.mark.slow
def test_hugging_face_datasets_reads_every_sample(made, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "cache"))
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")
    _, out = made
    files = [str(path) for path in sorted(out.glob("*.tar"))]
    read = datasets.load_dataset(
        "webdataset", data_files={"train": files}, split="train", cache_dir=str(tmp_path)
    )
    assert len(read) == 6
    np.testing.assert_array_equal(np.asarray(read[2]["png"])[..., :3], Shards(out)[2]["rgb"])


@pytest.mark.filterwarnings("ignore:__array__:DeprecationWarning")  # of its masks
def test_pycocotools_takes_the_boxes_of_a_sample_and_of_all(made, tmp_path, capsys):
    coco = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    _, out = made
    with tarfile.open(out / "shard-000000.tar") as tar:
        member = tar.extractfile("000000000.coco.json")
        (tmp_path / "000000000.coco.json").write_bytes(member.read())
    boxes = coco.COCO(str(tmp_path / "000000000.coco.json"))
    assert boxes.annToMask(boxes.loadAnns(boxes.getAnnIds()[:1])[0]).any()
    done = _omnisim("dataset", "convert", out, "-o", tmp_path / "coco")
    assert done.exit_code == 0, done.output
    boxes = coco.COCO(str(tmp_path / "coco" / "annotations.json"))
    capsys.readouterr()
    images = boxes.loadImgs(boxes.getImgIds())
    assert [one["file_name"] for one in images] == [f"{n:09d}.png" for n in range(6)]
    shards = Shards(out)
    for row, image in enumerate(images):
        sample = shards[row]
        pixels = read_image(tmp_path / "coco" / "images" / image["file_name"])[0]
        np.testing.assert_array_equal(pixels, sample["rgb"])
        instances = sample["instance"]
        found = boxes.loadAnns(boxes.getAnnIds(imgIds=[image["id"]]))
        assert sorted(one["instance_id"] for one in found) == sorted(set(instances[instances > 0]))
    again = _omnisim("dataset", "convert", out, "-o", tmp_path / "coco")
    assert "already exists" in str(again.exception)


@pytest.mark.filterwarnings("ignore:__array__:DeprecationWarning")  # of its masks
def test_small_objects_are_left_out_of_splits_with_polygons(made, tmp_path, capsys):
    """Both splits have each image once, and polygons are the masks of the run lengths."""
    coco = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    _, out = made
    assert _omnisim("dataset", "convert", out, "-o", tmp_path / "all").exit_code == 0
    everything = coco.COCO(str(tmp_path / "all" / "annotations.json"))
    areas = sorted(ann["area"] for ann in everything.anns.values())
    least = areas[len(areas) // 2]
    done = _omnisim(
        "dataset", "convert", out, "-o", tmp_path / "coco", "--min-area-px", least, "--polygons",
        "--split", "train=0.7,val=0.3",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    names, count = [], 0
    same = {(ann["image_id"], ann["instance_id"]): ann for ann in everything.anns.values()}
    for split in ("train", "val"):
        boxes = coco.COCO(str(tmp_path / "coco" / f"annotations_{split}.json"))
        names += [image["file_name"] for image in boxes.imgs.values()]
        assert boxes.cats == everything.cats
        for ann in boxes.anns.values():
            count += 1
            whole = everything.annToMask(same[ann["image_id"], ann["instance_id"]])
            np.testing.assert_array_equal(boxes.annToMask(ann), whole)
    capsys.readouterr()
    assert sorted(names) == [f"{n:09d}.png" for n in range(6)]
    assert count == sum(area >= least for area in areas) < len(areas)


def test_splits_stay_as_they_are_when_a_data_set_grows():
    settings = CocoSettings(splits={"train": 0.8, "val": 0.15, "test": 0.05})
    found = [settings.split_of(number) for number in range(1000)]
    for name, share in settings.splits.items():
        assert abs(found.count(name) - 1000 * share) <= 3
        assert abs(found[:200].count(name) - 200 * share) <= 3
    assert CocoSettings().split_of(7) == ""


def test_a_shard_with_a_damaged_header_is_named(made, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(made[1], out)
    content = bytearray((out / "shard-000001.tar").read_bytes())
    with tarfile.open(out / "shard-000001.tar") as tar:
        second = tar.getmember("000000004.channels.json")
    content[second.offset] ^= 0xFF  # a header: what follows is lost
    (out / "shard-000001.tar").write_bytes(content)
    for words in (("view", out, "-o", tmp_path / "v.png"), ("check", out)):
        done = _omnisim("dataset", *words)
        assert isinstance(done.exception, OmnisimError)
        assert "shard-000001.tar: is damaged: expected " in str(done.exception)


def test_free_floors_are_found_once_for_all_processes(tmp_path, monkeypatch):
    plan, out = write_plan(tmp_path), tmp_path / "out"
    assert _omnisim("generate", plan, "-o", out, "--shards", "0").exit_code == 0
    (kept,) = out.glob(".free-*.npz")
    found = []

    def find(*given):
        found.append(given)
        return find_free_space(*given)

    monkeypatch.setattr("omnisim.datasets.generate.prepared_plan.find_free_space", find)
    known = PreparedPlan.read(plan, out).free_space(0)
    assert not found
    np.testing.assert_array_equal(known.is_free, PreparedPlan.read(plan).free_space(0).is_free)
    assert len(found) == 1
    for damage in (b"", kept.read_bytes()[:-100], b"PK" + kept.read_bytes()[2:200]):
        kept.write_bytes(damage)
        again = PreparedPlan.read(plan, out).free_space(0)
        np.testing.assert_array_equal(again.clearance_m, known.clearance_m)
    assert len(found) == 4
    assert _omnisim("generate", plan, "-o", out).exit_code == 0
    assert not list(out.glob(".*"))


def test_a_process_at_work_keeps_a_folder_that_another_gives_up(tmp_path, needs_opengl):
    path, folder = write_plan(tmp_path, images_per_shard=1), tmp_path / "set"
    first = Generation(path, folder, range(0, 1))
    second = Generation(path, folder, range(1, 2))
    second.give_up()  # which has not taken it
    assert (folder / "plan.json").is_file()
    first.give_up()
    assert not (folder / "plan.json").exists()
    list(second.run())
    list(Generation(path, folder).run())
    assert Generation(path, folder).finish() is not None


def test_a_damaged_summary_is_none(tmp_path):
    (tmp_path / "shard-000000.tar").write_bytes(b"")
    for text in ("[" * 100_000, "[]", '{"shard": 1e999}', "\x00"):
        (tmp_path / "shard-000000.json").write_text(text)
        assert find_shard(tmp_path, 0) is None
