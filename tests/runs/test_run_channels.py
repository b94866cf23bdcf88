"""Drives with ground truth: what they leave on disk, and that they go on and end the same."""

import dataclasses
import json
import shutil

import numpy as np
import pytest

from omnisim.core.errors import RunError
from omnisim.core.files.image_files import read_channels
from omnisim.ground_truth import CHANNELS
from omnisim.ground_truth.channel_files import ChannelFormat
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.runs.run_folder import RunFolder
from omnisim.scene import load_scene

pytestmark = pytest.mark.usefixtures("needs_opengl")
STEPS = 4


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    vehicle = Vehicle.load("p2at").with_cameras(size_px=36)
    path = tmp_path_factory.mktemp("paths") / "corner.csv"
    path.write_text("x_m,y_m\n-1.0,0.5\n0.2,0.5\n0.2,1.5\n")
    route = Route(str(path), step_m=10.0, step_deg=90.0)
    return Drive(load_scene("soccer"), vehicle, route, channels=tuple(CHANNELS))


@pytest.fixture(scope="module")
def whole(drive, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "whole"
    assert list(drive.plan().record(folder))[-1] == STEPS
    return folder


def _bytes(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_every_step_has_its_channels_and_flows_to_the_steps_beside_it(drive, whole):
    labels = json.loads((whole / "labels.json").read_text())
    names = {label["id"]: label["name"] for label in labels["classes"]}
    seen = set()
    poses = drive.plan().truth.world_from_base
    for step in range(STEPS):
        found = read_channels(whole / "omnicam" / f"{step:06d}.channels.exr")
        others = {"next": step + 1, "previous": step - 1}
        np.testing.assert_allclose(found.metadata["world_from_base"], poses[step])
        for channel in CHANNELS.values():
            is_there = others.get(channel.other, step) in range(STEPS)
            assert (channel.layers[0] in found.values) == is_there
        for other, number in others.items():
            key = f"{other}_world_from_base"
            assert (key in found.metadata) == (number in range(STEPS))
            if key in found.metadata:
                np.testing.assert_allclose(found.metadata[key], poses[number])
        seen |= {names[int(number)] for number in np.unique(found.values["semantic"])}
        body = found.values["semantic"] == next(n for n in names if names[n] == "vehicle")
        # the body stays where it is in the image, however the vehicle moves
        assert body.sum() > 20
        for part in ("flow.U", "flow.V", "flow_backward.U", "scene_flow_camera.X"):
            if part in found.values:
                assert np.abs(found.values[part][body]).max() < 1e-3
    assert {"vehicle", "carpet", "field_line"} <= seen


def test_the_boxes_of_all_steps_are_in_one_file(whole):
    content = json.loads((whole / "omnicam" / "coco.json").read_text())
    assert [image["id"] for image in content["images"]] == list(range(STEPS))
    for image in content["images"]:
        assert (whole / "omnicam" / image["file_name"]).is_file()
    single = json.loads((whole / "omnicam" / "000002.coco.json").read_text())
    mine = [one for one in content["annotations"] if one["image_id"] == 2]
    assert [one["bbox"] for one in mine] == [one["bbox"] for one in single["annotations"]]


def test_what_is_missing_comes_back_with_the_same_bytes(drive, whole):
    before = _bytes(whole)
    for name in ("000000.channels.exr", "000001.png", "000002.coco.json", "coco.json"):
        (whole / "omnicam" / name).unlink()
    (whole / "omnicam" / "000001.channels.exr").write_bytes(b"")  # a power cut
    assert list(drive.plan().record(whole)) == [STEPS - 3, STEPS - 2, STEPS - 1, STEPS]
    assert _bytes(whole) == before
    # whichever step is the first of the process
    (whole / "omnicam" / "000002.channels.exr").unlink()
    assert list(drive.plan().record(whole)) == [STEPS - 1, STEPS]
    assert _bytes(whole) == before


def test_other_channels_are_another_run_and_force_leaves_nothing_of_them(drive, whole, tmp_path):
    folder, before = tmp_path / "run", _bytes(whole)
    shutil.copytree(whole, folder)
    plain = dataclasses.replace(drive, channels=())
    with pytest.raises(RunError, match="another run is in this folder"):
        list(plain.plan().record(folder))
    assert _bytes(folder) == before
    next(plain.plan().record(folder, force=True))
    left = {path.name for path in folder.rglob("*") if "coco" in path.name or "exr" in path.name}
    assert left == set()
    assert not (folder / "labels.json").exists()


def test_flow_alone_leaves_no_file_at_the_last_step(drive, tmp_path):
    folder = tmp_path / "run"
    flow = dataclasses.replace(drive, channels=("flow", "occluded"))
    assert list(flow.plan().record(folder))[-1] == STEPS
    there = sorted(path.name for path in (folder / "omnicam").glob("*.exr"))
    assert there == [f"{step:06d}.channels.exr" for step in range(STEPS - 1)]
    assert list(flow.plan().record(folder)) == [STEPS]


def test_a_run_of_one_step_has_no_flows(whole):
    run = RunFolder.read(whole)
    run = dataclasses.replace(run, manifest=run.manifest.model_copy(update={"steps": 1}))
    alone = tuple(name for name in CHANNELS if not CHANNELS[name].other)
    assert run.channels_at(0, run.camera()) == alone


def test_boxes_3d_of_a_run(drive, tmp_path):
    folder = tmp_path / "run"
    boxed = dataclasses.replace(drive, channels=(), boxes_3d=True)
    assert list(boxed.plan().record(folder))[-1] == STEPS
    before = _bytes(folder)
    files = sorted((folder / "omnicam").glob("*.boxes_3d.json"))
    assert [path.name[:6] for path in files] == [f"{step:06d}" for step in range(STEPS)]
    content = json.loads(files[1].read_text())
    body = [one for one in content["boxes"] if one["category_name"] == "vehicle"]
    carpet = [one for one in content["boxes"] if one["instance_name"] == "carpet"]
    assert len(body) > 3
    np.testing.assert_allclose(sorted(carpet[0]["full"]["size_m"]), (0.006, 4.0, 6.0), atol=1e-6)
    files[1].unlink()
    assert list(boxed.plan().record(folder)) == [STEPS - 1, STEPS]
    assert _bytes(folder) == before
    next(dataclasses.replace(drive, channels=()).plan().record(folder, force=True))
    assert not list((folder / "omnicam").glob("*.boxes_3d.json"))


@pytest.mark.slow
def test_npy_files_of_a_run_go_on_with_the_same_bytes(drive, whole, tmp_path):
    folder = tmp_path / "run"
    npy = dataclasses.replace(drive, channel_format=ChannelFormat.NPY)
    assert list(npy.plan().record(folder))[-1] == STEPS
    before, camera = _bytes(folder), folder / "omnicam"
    assert not list(camera.glob("*.exr"))
    for step in range(STEPS):
        layers = read_channels(whole / "omnicam" / f"{step:06d}.channels.exr").values
        names = {name for name in CHANNELS if CHANNELS[name].layers[0] in layers}
        assert {path.name.split(".")[1] for path in camera.glob(f"{step:06d}.*.npy")} == names
        ranges_m = np.load(camera / f"{step:06d}.range.npy")
        np.testing.assert_array_equal(ranges_m, layers["range"])
    described = json.loads((camera / "000001.channels.json").read_text())
    assert described["channels"]["range"]["npy"]["file"] == "000001.range.npy"
    (camera / "000001.flow.npy").unlink()
    (camera / "000002.channels.json").unlink()
    assert list(npy.plan().record(folder)) == [STEPS - 2, STEPS - 1, STEPS]
    assert _bytes(folder) == before
    with pytest.raises(RunError, match="channel_format was 'npy', is None"):
        list(drive.plan().record(folder))
    next(dataclasses.replace(drive, channels=()).plan().record(folder, force=True))
    assert not list(camera.glob("*.npy")) + list(camera.glob("*.channels.json"))
