"""`omnisim render --also` and `omnisim drive --also`: files and errors."""

import json

import numpy as np
import pytest

from omnisim.core.files.image_files import read_channels, read_image

SMALL = ["--size", "40"]


def test_all_channels_in_one_exr(omnisim, tmp_path, needs_opengl):
    status, out, err = omnisim(
        "render", "soccer", *SMALL, "--also", "range,semantic,instance,normals,flow", "-o", "f.exr"
    )
    assert status == 0, err
    assert err == ""
    assert "also range, normals, semantic, instance, flow, occluded" in out
    assert "flow to (-1.1, -0.5, 0.6) m at yaw 0°, assuming 0.1 m ahead (set --next)" in out
    found = read_channels(tmp_path / "f.exr")
    assert {"R", "range", "normal.X", "semantic", "instance", "flow.U", "occluded"} <= set(
        found.values
    )
    # soccer's walls and lawn are all around: nothing but what is outside of the mirror is infinite
    assert np.isfinite(found.values["range"]).mean() > 0.7
    assert {path.name for path in tmp_path.iterdir()} == {"f.exr", "f.coco.json"}


def test_files_and_previews_beside_a_image(omnisim, tmp_path, needs_opengl):
    (tmp_path / "labels.toml").write_text(
        '[[labels]]\nname = "grass"\nnodes = ["carpet"]\ncolor = [1, 2, 3]\n'
    )
    status, out, err = omnisim(
        "render", "soccer", *SMALL, "--also", "semantic,flow", "--labels", "labels.toml",
        "--next", -1.0, -0.5, 0.6, "--next-yaw", 5, "--preview", "-o", "f.png",
    )  # fmt: skip
    assert status == 0, err
    assert "no label for 236 instances, such as" in err
    assert "flow to (-1, -0.5, 0.6) m at yaw 5°\n" in out
    document = json.loads((tmp_path / "f.channels.json").read_text())
    assert document["labels"]["classes"][1] == {"id": 1, "name": "grass", "color": [1, 2, 3]}
    assert document["channels"].keys() == {"semantic", "flow", "occluded"}
    for name in ("semantic", "flow", "occluded"):
        assert (tmp_path / f"f.{name}.png").is_file()
        assert (tmp_path / f"f.{name}.preview.png").is_file()


def test_channels_as_npy(omnisim, tmp_path, needs_opengl):
    command = ["render", "soccer", *SMALL, "--also", "range,flow_backward", "-o", "f.exr"]
    status, out, err = omnisim(*command, "--channel-format", "npy")
    assert status == 0, err
    assert "; backward flow to (-1.3, -0.5, 0.6) m at yaw 0°, assuming 0.1 m behind (set" in out
    assert set(read_channels(tmp_path / "f.exr").values) == {"R", "G", "B"}
    assert np.load(tmp_path / "f.range.npy").shape == (40, 40)
    assert np.load(tmp_path / "f.flow_backward.npy").shape == (40, 40, 2)


def test_boxes_3d(omnisim, tmp_path, needs_opengl):
    status, out, err = omnisim("render", "soccer", *SMALL, "--boxes-3d", "-o", "f.png")
    assert status == 0, err
    assert "f.boxes_3d.json: 3-D boxes of " in out
    assert {path.name for path in tmp_path.iterdir()} == {"f.png", "f.boxes_3d.json"}
    content = json.loads((tmp_path / "f.boxes_3d.json").read_text())
    assert "goal_yellow" in {one["category_name"] for one in content["boxes"]}


def test_coarse_ranges_are_said(omnisim, tmp_path, needs_opengl):
    (tmp_path / "far.obj").write_text("v 90 -9 -9\nv 90 9 -9\nv 90 0 9\nf 1 3 2\nf 1 2 3\n")
    arguments = ["far.obj", "--up", "z", *SMALL, "--at", 0, 0, 0, "--also", "range"]
    status, _, err = omnisim("render", *arguments, "-o", "f.png")
    assert status == 0, err
    assert "f.range.png: 2 mm per step instead of 1, to hold ranges beyond 65.534 m" in err
    steps = read_image(tmp_path / "f.range.png")[0]
    assert {0, 65535} < set(np.unique(steps).tolist())
    hit = (steps > 0) & (steps < 65535)
    assert hit.any()
    assert (steps[hit] >= 45_000).all()


def test_a_drive_refuses_unknown_channels(omnisim, tmp_path):
    arguments = ["drive", "soccer", "--robot", "p2at", "--path", "lap", "-o", "run"]
    status, _, err = omnisim(*arguments, "--also", "instances")
    assert status == 1
    assert "channel 'instances': there is no such channel; did you mean 'instance'?" in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "output", "others"),
    [("boxes", "f.png", []), ("labels", "f.exr", ["--also", "range"])],
)
def test_an_overlay_is_beside_the_image(omnisim, tmp_path, needs_opengl, kind, output, others):
    status, out, err = omnisim("render", "soccer", *SMALL, "--overlay", kind, *others, "-o", output)
    assert status == 0, err
    assert f"f.overlay.png: the image with {kind}" in out
    assert {path.name for path in tmp_path.iterdir()} == {output, "f.overlay.png"}
    overlay, _ = read_image(tmp_path / "f.overlay.png")
    assert overlay.shape[:2] == (480, 480)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ([], "--overlay masks: expected boxes or labels"),
        (["--rays", "f.overlay.png"], "--rays: expected"),
    ],
)
def test_overlays_that_cannot_be(omnisim, options, line):
    kind = "boxes" if options else "masks"
    status, _, err = omnisim("render", "rings", "--overlay", kind, *options, "-o", "f.png")
    assert status in (1, 2)
    assert err.count("\n") == 1
    assert line.split(":")[0].split()[0] in err
