"""The bar: on a terminal only, and nobody draws while a turn is timed."""

import io
import threading

from rich.console import Console

from benchmarks.progress import show_progress


def test_bar_is_drawn_between_rounds_and_by_no_thread():
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=True)
    before = threading.active_count()
    seen = []
    for step in show_progress(range(-1, 3), "fps: [soccer]", 4, console):
        seen.append(step)
        assert threading.active_count() == before
    assert seen == [-1, 0, 1, 2]
    assert "fps: [soccer]" in shown.getvalue()
    assert "75%" in shown.getvalue()


def test_no_bar_without_a_terminal():
    shown = io.StringIO()
    assert list(show_progress(range(3), "fps", 3, Console(file=shown))) == [0, 1, 2]
    assert shown.getvalue() == ""
