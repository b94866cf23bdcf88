"""SDF's geometries against their closed forms."""

import math

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.scene.formats.sdf.geometry import segment_limit
from tests.scene.formats.sdf.worlds import load, model, sdf, visual
from tests.scene.world_corners import solid_of

# A circle's polygon differs from it by some 1e-4 of its area.
ROUND = 1e-3
# Volume, and half sizes of the bounds.
SHAPES = {
    "<box><size>1 2 3</size></box>": (6.0, (0.5, 1.0, 1.5)),
    "<sphere><radius>0.5</radius></sphere>": (math.pi / 6, (0.5, 0.5, 0.5)),
    "<cylinder><radius>0.5</radius><length>2</length></cylinder>": (math.pi / 2, (0.5, 0.5, 1)),
    "<capsule><radius>0.5</radius><length>2</length></capsule>":
        (math.pi / 2 + math.pi / 6, (0.5, 0.5, 1.5)),
    "<cone><radius>0.5</radius><length>2</length></cone>": (math.pi / 6, (0.5, 0.5, 1)),
    "<ellipsoid><radii>0.5 1 2</radii></ellipsoid>": (4 / 3 * math.pi, (0.5, 1.0, 2.0)),
}  # fmt: skip


@pytest.mark.parametrize("text", SHAPES, ids=lambda text: text[1 : text.index(">")])
def test_a_solid_is_closed_and_has_its_volume_and_bounds(tmp_path, text):
    solid = solid_of(load(tmp_path, sdf(model("a", visual(text)))))
    volume, half_sizes = SHAPES[text]
    assert solid.is_watertight
    assert solid.volume == pytest.approx(volume, rel=2 * ROUND)  # positive: fronts outside
    assert solid.bounds == pytest.approx(np.multiply(((-1,), (1,)), half_sizes), abs=ROUND)


def test_a_plane_is_across_its_normal(tmp_path):
    text = "<plane><normal>0 1 1</normal><size>4 2</size></plane>"
    plane = solid_of(load(tmp_path, sdf(model("a", visual(text)))))
    assert plane.area == pytest.approx(8.0)
    assert plane.face_normals == pytest.approx(np.tile((0, 0.5**0.5, 0.5**0.5), (2, 1)), abs=1e-6)
    x, y, z = plane.bounds[1]
    assert (x, y, z) == pytest.approx((2.0, 0.5**0.5, 0.5**0.5))


def _points(corners):
    return "".join(f"<point>{x} {y}</point>" for x, y in corners)


L_SHAPE = ((0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3))
HOLE = ((0.2, 0.2), (0.2, 0.8), (0.8, 0.8), (0.8, 0.2))


@pytest.mark.parametrize("turn", [1, -1])
def test_a_polyline_is_extruded_with_its_holes(tmp_path, turn):
    """The first of its points may be repeated at its end."""
    lines = "".join(
        f"<polyline>{_points(corners[::turn])}<height>2</height></polyline>"
        for corners in ((*L_SHAPE, L_SHAPE[0]), HOLE)
    )
    solid = solid_of(load(tmp_path, sdf(model("a", visual(lines)))))
    assert solid.is_watertight
    assert solid.volume == pytest.approx(2.0 * (5.0 - 0.36), rel=1e-6)
    assert solid.bounds == pytest.approx(np.array(((0.0, 0, 0), (3, 3, 2))))


def test_a_star_with_many_points_is_filled(tmp_path):
    angles = np.linspace(0, 2 * math.pi, 40, endpoint=False)
    radii = np.where(np.arange(40) % 2, 1.0, 0.3)
    corners = np.stack((radii * np.cos(angles), radii * np.sin(angles)), axis=1)
    text = f"<polyline>{_points(corners)}<height>1</height></polyline>"
    solid = solid_of(load(tmp_path, sdf(model("a", visual(text)))))
    x, y = corners.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))  # the shoelace formula
    assert solid.volume == pytest.approx(area)


def test_equal_shapes_are_one_mesh(tmp_path):
    text = "<sphere><radius>0.5</radius></sphere>"
    scene = load(tmp_path, sdf("".join(model(f"m{i}", visual(text)) for i in range(9))))
    assert len(scene.instances) == 9
    assert len(scene.meshes) == 1


def test_many_round_shapes_are_coarser():
    assert [segment_limit(count) for count in (0, 20, 80, 500, 10**6)] == [160, 160, 80, 32, 16]


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ("<box><size>1 2</size></box>", "box/size: expected 3 numbers, got '1 2'"),
        ("<box><size>1 2 0</size></box>", "box/size: expected numbers > 0, got '1 2 0'"),
        ("<sphere><radius>big</radius></sphere>", "sphere/radius: expected a number, got 'big'"),
        ("<sphere><radius>nan</radius></sphere>", "sphere/radius: expected a number, got 'nan'"),
        ("<cone><radius>-1</radius></cone>", "cone/radius: expected a number > 0, got '-1'"),
        ("<plane><normal>0 0 0</normal></plane>", "plane: expected a <normal> other than 0 0 0"),
        ("<polyline><point>0 0</point></polyline>", "polyline: expected three points or more"),
    ],
)
def test_a_size_that_is_none_is_named(tmp_path, geometry, message):
    with pytest.raises(SceneError) as info:
        load(tmp_path, sdf(model("a", visual(geometry))))
    place = "test.world: model[a]/link[link]/visual[visual]/geometry/"
    assert f"{place}{message}" in str(info.value)
    assert "\n" not in str(info.value)
