"""Grid of errors over varied values."""

import math

import numpy as np

from omnisim.plots.estimator_plots import SweepLine, SweepPanel, sweep_grid


def test_a_grid_has_a_panel_for_each_measure_and_one_legend():
    nan = math.nan
    lines = [
        SweepLine("a", [1.0, nan, 2.0], [0.1, nan, nan]),
        SweepLine("b", [3.0, 4.0, 5.0], [nan] * 3),
    ]
    numeric = SweepPanel("angle (°)", "ATE", ["90", "120", "220"], lines, "no trajectory")
    named = SweepPanel("camera", "lost", ["pinhole", "fisheye", "mirror"], lines[1:])
    figure = sweep_grid([[numeric, named], [named, numeric]])
    assert [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes] == [
        ("angle (°)", "ATE"), ("camera", "lost"), ("camera", "lost"), ("angle (°)", "ATE"),
    ]  # fmt: skip
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["no trajectory", "a", "b"]
    assert np.array_equal(figure.axes[0].get_xticks(), (90.0, 120.0, 220.0))
    assert np.array_equal(figure.axes[1].get_xticks(), (0.0, 1.0, 2.0))


def test_a_logarithmic_axis_shows_an_ideal_sensor():
    """Six decades below the worst: rounding is the only error of an ideal IMU."""
    panel = SweepPanel("IMU", "ATE", ["ideal", "bmi160"], [SweepLine("imu", [2e-5, 20.0], [0, 0])])
    (axes,) = sweep_grid([[panel]]).axes
    bottom, top = axes.get_ylim()
    assert axes.get_yscale() == "log"
    assert bottom < 2e-5 < 20.0 < top
