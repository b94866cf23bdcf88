"""Draws of samples: places, attitudes, colors and objects."""

import numpy as np
import pytest
import trimesh

from omnisim.core.errors import PlanError
from omnisim.datasets.generate.draw import draw, draw_indices
from omnisim.datasets.generate.plan import read_plan
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.scene import load_scene
from tests.datasets.plans import write_plan

BALL = '[[objects]]\nfile = "ball.obj"\ncount = [2, 4]\ndistance_m = [0.5, 2.0]'


def _ball(folder, radius_m=0.1):
    trimesh.creation.icosphere(subdivisions=1, radius=radius_m).export(folder / "ball.obj")


def _prepared(folder, text="", **options):
    return PreparedPlan.read(write_plan(folder, text, **options))


def test_a_draw_is_a_function_of_seed_and_number(tmp_path):
    prepared = _prepared(tmp_path, "[viewpoints]\nheight_m = [0.5, 1.0]", scene="soccer")
    first, again = draw(prepared, 5, 0), draw(_prepared(tmp_path, scene="soccer"), 5, 0)
    np.testing.assert_array_equal(first.position_m[:2], again.position_m[:2])
    assert first.yaw_deg == again.yaw_deg
    others = [draw(prepared, 6, 0), draw(prepared, 5, 1)]
    assert all(np.any(first.position_m != other.position_m) for other in others)


def test_places_along_a_path_are_on_it(tmp_path):
    text = '[viewpoints]\nwhere = "path"\npaths = ["lap"]\nheight_m = 0.7'
    prepared = _prepared(tmp_path, text, scene="soccer")
    path = next(one for one in load_scene("soccer").paths if one.name == "lap")
    corners = np.array(path.waypoints_m)
    for number in range(20):
        drawn = draw(prepared, number, 0)
        begins, ways = corners[:-1], np.diff(corners, axis=0)
        shares = np.einsum("nc,nc->n", drawn.position_m[:2] - begins, ways) / (ways**2).sum(axis=1)
        nearest = begins + np.clip(shares, 0.0, 1.0)[:, None] * ways
        distances = np.linalg.norm(drawn.position_m[:2] - nearest, axis=1)
        assert distances.min() < 1e-9
        leg = ways[np.argmin(distances)]
        heading = np.array((np.cos(np.radians(drawn.yaw_deg)), np.sin(np.radians(drawn.yaw_deg))))
        assert heading @ leg / np.linalg.norm(leg) == pytest.approx(1.0)


def test_places_around_an_object_look_at_it(tmp_path):
    text = '[viewpoints]\nwhere = "around"\nnodes = ["goal_yellow*"]\ndistance_m = [1.0, 2.0]'
    prepared = _prepared(tmp_path, text, scene="soccer")
    middles = np.array(prepared.middles(0))
    for number in range(20):
        drawn = draw(prepared, number, 0)
        ways = middles[:, :2] - drawn.position_m[:2]
        lengths = np.linalg.norm(ways, axis=1)
        heading = np.array((np.cos(np.radians(drawn.yaw_deg)), np.sin(np.radians(drawn.yaw_deg))))
        ahead = (ways @ heading > 0.999999 * lengths) & (lengths >= 0.999) & (lengths <= 2.001)
        assert ahead.any()


def test_poses_of_a_file_are_taken(tmp_path):
    (tmp_path / "poses.tum").write_text("0 1 2 0.5 0 0 0.7071067811865476 0.7071067811865476\n")
    prepared = _prepared(tmp_path, '[viewpoints]\nwhere = "poses"\nfile = "poses.tum"')
    drawn = draw(prepared, 3, 0)
    np.testing.assert_allclose(drawn.position_m, (1.0, 2.0, 0.5))
    assert drawn.yaw_deg == pytest.approx(90.0)


def test_objects_stand_on_the_floor_and_do_not_touch(tmp_path):
    _ball(tmp_path)
    prepared = _prepared(tmp_path, BALL, scene="soccer")
    free, counts = prepared.free_space(0), set()
    for number in range(20):
        drawn = draw(prepared, number, 0)
        middles = [placed.world_from_object[:3, 3] for placed in drawn.objects]
        counts.add(len(middles))
        for index, middle in enumerate(middles):
            cell = free.cell_of(middle[:2])
            assert middle[2] - 0.1 == pytest.approx(free.floor_m[cell], abs=1e-3)
            assert free.clearance_m[cell] > 0.1
            assert np.linalg.norm(middle[:2] - drawn.position_m[:2]) > 0.35
            assert all(np.linalg.norm(middle - other) > 0.2 for other in middles[:index])
    assert counts == {2, 3, 4}


def test_no_place_for_an_object_is_one_line(tmp_path):
    _ball(tmp_path, radius_m=3.0)
    prepared = _prepared(tmp_path, BALL, scene="soccer")
    with pytest.raises(PlanError, match="objects: ball: no free place of ") as caught:
        draw(prepared, 0, 0)
    assert "\n" not in str(caught.value)


def test_colors_are_drawn_for_their_share(tmp_path):
    text = '[[vary.recolor]]\nnodes = ["goal_*"]\nshare = 0.5\nhue_deg = 120\n'
    text += "saturation = 1\nvalue = 1"
    prepared = _prepared(tmp_path, text, scene="soccer")
    drawn = [draw(prepared, number, 0).colors for number in range(40)]
    assert {name.startswith("goal_") for one in drawn for name in one} == {True}
    assert {color for one in drawn for color in one.values()} == {(0.0, 1.0, 0.0)}
    share = np.mean([len(one) for one in drawn]) / len(prepared.instances(0, ["goal_*"], ""))
    assert 0.3 < share < 0.7


def test_weights_part_the_samples(tmp_path):
    text = '[[scenes]]\nfile = "courtyard"\nweight = 3.0\n'
    plan = read_plan(write_plan(tmp_path, text))
    shares = np.mean([draw_indices(plan, number).scene for number in range(2000)])
    assert shares == pytest.approx(0.75, abs=0.03)
