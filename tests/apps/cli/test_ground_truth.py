"""`omnisim render --also` and `omnisim drive --also`: files and errors."""

import json

import numpy as np
import pytest

from omnisim.core.files.image_files import read_channels, read_image

SMALL = ["--size", "32"]


@pytest.fixture
def render(ran, needs_opengl):
    """Renders a small image of a scene; returns standard output and error."""

    def run(*options, scene="soccer"):
        return ran("render", scene, *SMALL, *options)

    return run


def names_in(folder):
    return {path.name for path in folder.iterdir()}


def test_all_channels_in_one_exr(render, tmp_path):
    out, err = render("--also", "range,semantic,instance,normals,flow", "-o", "f.exr")
    assert err == ""
    assert "also range, normals, semantic, instance, flow, occluded" in out
    assert "flow to (-1.1, -0.5, 0.6) m at yaw 0°, assuming 0.1 m ahead (set --next)" in out
    found = read_channels(tmp_path / "f.exr").values
    assert found.keys() > {"R", "range", "normal.X", "semantic", "instance", "flow.U", "occluded"}
    # soccer's walls and lawn are all around: nothing but what is outside of the mirror is infinite
    assert np.isfinite(found["range"]).mean() > 0.7
    assert names_in(tmp_path) == {"f.exr", "f.coco.json"}


def test_files_and_previews_beside_a_image(render, tmp_path):
    (tmp_path / "labels.toml").write_text(
        '[[labels]]\nname = "grass"\nnodes = ["carpet"]\ncolor = [1, 2, 3]\n'
    )
    out, err = render(
        "--also", "semantic,flow", "--labels", "labels.toml", "--next", -1.0, -0.5, 0.6,
        "--next-yaw", 5, "--preview", "-o", "f.png",
    )  # fmt: skip
    assert "no label for 236 instances, such as" in err
    assert "flow to (-1, -0.5, 0.6) m at yaw 5°\n" in out
    document = json.loads((tmp_path / "f.channels.json").read_text())
    assert document["labels"]["classes"][1] == {"id": 1, "name": "grass", "color": [1, 2, 3]}
    assert document["channels"].keys() == {"semantic", "flow", "occluded"}
    for name in ("semantic", "flow", "occluded"):
        assert names_in(tmp_path) > {f"f.{name}.png", f"f.{name}.preview.png"}


def test_channels_as_npy(render, tmp_path):
    out, _ = render("--also", "range,flow_backward", "-o", "f.exr", "--channel-format", "npy")
    assert "; backward flow to (-1.3, -0.5, 0.6) m at yaw 0°, assuming 0.1 m behind (set" in out
    assert set(read_channels(tmp_path / "f.exr").values) == {"R", "G", "B"}
    assert np.load(tmp_path / "f.range.npy").shape == (32, 32)
    assert np.load(tmp_path / "f.flow_backward.npy").shape == (32, 32, 2)


def test_boxes_3d(render, tmp_path):
    out, _ = render("--boxes-3d", "-o", "f.png")
    assert "f.boxes_3d.json: 3-D boxes of " in out
    assert names_in(tmp_path) == {"f.png", "f.boxes_3d.json"}
    content = json.loads((tmp_path / "f.boxes_3d.json").read_text())
    assert "goal_yellow" in {box["category_name"] for box in content["boxes"]}


def test_coarse_ranges_are_said(render, tmp_path):
    (tmp_path / "far.obj").write_text("v 90 -9 -9\nv 90 9 -9\nv 90 0 9\nf 1 3 2\nf 1 2 3\n")
    options = ["--up", "z", "--at", 0, 0, 0, "--also", "range", "-o", "f.png"]
    _, err = render(*options, scene="far.obj")
    assert "f.range.png: 2 mm per step instead of 1, to hold ranges beyond 65.534 m" in err
    steps = read_image(tmp_path / "f.range.png")[0]
    assert {0, 65535} < set(np.unique(steps).tolist())
    hit = (steps > 0) & (steps < 65535)
    assert hit.any()
    assert (steps[hit] >= 45_000).all()


@pytest.mark.parametrize(
    ("kind", "output", "others"),
    [("boxes", "f.png", []), ("labels", "f.exr", ["--also", "range"])],
)
def test_an_overlay_is_beside_the_image(render, tmp_path, kind, output, others):
    out, _ = render("--overlay", kind, *others, "-o", output)
    assert f"f.overlay.png: the image with {kind}" in out
    assert names_in(tmp_path) == {output, "f.overlay.png"}
    overlay, _ = read_image(tmp_path / "f.overlay.png")
    assert overlay.shape[:2] == (480, 480)
