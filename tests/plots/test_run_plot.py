"""The plot of a run: what it says where things share a place, or are few."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.trajectories import Trajectory
from omnisim.plots.run_plot import RunDrawing, run_figure, steps_to_show
from omnisim.scene import load_scene
from omnisim.scene.model import DynamicObject
from omnisim.scene.motion.object_motion import Rest


def _figure(places_m, steps, scene=None, title="a run"):
    places = np.array(places_m, dtype=np.float64)
    truth = Trajectory.on_ground(np.arange(len(places)), places, np.zeros(len(places)))
    images = {step: np.zeros((8, 8, 3), np.uint8) for step in steps}
    return run_figure(title, scene, [RunDrawing(truth, places, images)])


def test_steps_at_one_place_share_a_label():
    there_and_back = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 0.001), (0.0, 0.0)]
    figure = _figure(there_and_back, [0, 1, 3, 4])
    assert [text.get_text() for text in figure.axes[0].texts] == ["0, 4", "1, 3"]


def test_names_of_landmarks_stay_on_the_map():
    figure = _figure([(0.0, 0.0)], [0], load_scene("soccer"))
    found = {text.get_text(): text for text in figure.axes[0].texts}
    figure.draw_without_rendering()
    inside = figure.axes[0].get_window_extent()
    for name in ("goal_yellow", "goal_blue", "beacon_left_yellow"):
        box = found[name].get_window_extent()
        assert inside.x0 <= box.x0
        assert box.x1 <= inside.x1


def test_a_scene_where_everything_moves_is_drawn_as_it_begins():
    soccer = load_scene("soccer")
    moving = DynamicObject("all", soccer, Rest((0.0, 0.0, 0.0)))
    empty = dataclasses.replace(soccer, meshes=(), materials=(), instances=(), objects=(moving,))
    map_of = [_figure([(0.0, 0.0)], [0], scene).axes[0] for scene in (soccer, empty)]
    still, begun = (
        [collection.get_paths() for collection in axes.collections[:2]] for axes in map_of
    )
    assert list(map(len, still)) == list(map(len, begun))


def test_one_image_does_not_fill_the_page():
    figure = _figure([(0.0, 0.0)], steps_to_show(1))
    assert len(figure.axes) == 2
    figure.draw_without_rendering()
    assert figure.axes[1].get_window_extent().height < 0.5 * figure.bbox.height


def test_a_long_title_is_broken():
    figure = _figure([(0.0, 0.0), (1.0, 0.0)], [], title="word " * 40)
    figure.draw_without_rendering()
    box = figure.axes[0].title.get_window_extent()
    assert box.x0 >= 0.0
    assert box.x1 <= figure.bbox.width


@pytest.mark.parametrize(("steps", "wanted"), [(1, [0]), (3, [0, 1, 2]), (11, [0, 2, 4, 6, 8, 10])])
def test_steps_to_show(steps, wanted):
    assert steps_to_show(steps) == wanted


def test_robots_that_drove_together_are_on_one_map():
    paths = {"a": [(0.0, 0.0), (1.0, 0.0)], "b": [(9.0, 4.0), (9.0, 5.0)]}
    runs = [
        RunDrawing(
            Trajectory.on_ground([0.0, 1.0], places, [0.0, 0.0]),
            np.array(places),
            {step: np.zeros((8, 8, 3), np.uint8) for step in steps},
            name,
        )
        for (name, places), steps in zip(paths.items(), ([0, 1], [0]), strict=True)
    ]
    figure = run_figure("a: first\nb: second", None, runs)
    axes, *strips = figure.axes
    lines = {line.get_label(): line for line in axes.lines}
    assert {"a: true path", "b: true path", "a: odometry", "b: odometry"} <= set(lines)
    for name, places in paths.items():
        np.testing.assert_allclose(lines[f"{name}: true path"].get_xydata(), places)
    assert lines["a: true path"].get_color() != lines["b: true path"].get_color()
    titles = [strip.get_title() for strip in strips]
    assert titles == ["a, step 0, 0.0 s", "a, step 1, 1.0 s", "b, step 0, 0.0 s"]
    low, high = axes.get_xlim()
    assert low < 0.0
    assert high > 9.0
