"""Sessions: the newest command is drawn, coarse while it moves, fine when it rests."""

import threading
import time

import pytest

from omnisim.apps.live import live_messages as messages
from omnisim.apps.live import session
from omnisim.apps.live.camera_document import CameraDocument
from omnisim.apps.live.session import PageDraw, Session
from omnisim.apps.live.viewpoint_motion import FreeFlight, Place
from omnisim.cameras import CAMERA_MODELS
from omnisim.core.errors import OmnisimError, OutputError


@pytest.fixture
def live(monkeypatch):
    monkeypatch.setattr(session, "REST_S", 0.0)
    monkeypatch.setattr(session, "HELD_S", 600.0)  # also where other processes hold the processor
    monkeypatch.setattr(session, "SAME_EDIT_S", 600.0)
    return Session(CameraDocument(), FreeFlight(Place((0.0, 0.0, 1.0))))


def _next(live):
    """The next image, drawn at once."""
    live.ask()
    draw = live.next_work()
    assert isinstance(draw, PageDraw)
    live.drawn(draw)
    return draw


def test_the_first_image_is_coarse_and_the_next_fine(live):
    assert [_next(live).is_fine, _next(live).is_fine] == [False, True]


def test_only_the_newest_of_many_wishes_is_drawn(live):
    _next(live), _next(live)
    for k in range(100):
        live.apply(messages.SetValue(path="sensor.mirror.k", value=3.0 + k))
    draw = _next(live)
    assert not draw.is_fine
    assert draw.state.document.value("sensor.mirror.k") == 102.0
    assert _next(live).is_fine


def test_nothing_is_drawn_until_somebody_asks(live):
    done = threading.Thread(target=live.next_work)
    done.start()
    done.join(0.1)
    assert done.is_alive()
    live.stop()
    done.join(120.0)
    assert not done.is_alive()


def test_images_are_coarse_while_a_key_is_held_and_fine_after(live):
    _next(live), _next(live)
    live.apply(messages.SetMotion(ahead=1.0))
    for _ in range(3):
        time.sleep(0.02)
        assert not _next(live).is_fine
    live.apply(messages.SetMotion())
    until = time.monotonic() + 120.0
    while not (draw := _next(live)).is_fine:
        assert time.monotonic() < until
    assert draw.state.place.position_m[0] > 0.0


def test_a_key_pressed_and_let_go_during_a_image_counts(live):
    _next(live), _next(live)
    live.apply(messages.SetMotion(turn=1.0))
    time.sleep(0.05)
    live.apply(messages.SetMotion())
    assert _next(live).state.place.yaw_deg > 0.0


def test_keys_are_let_go_when_the_page_is_silent(live, monkeypatch):
    monkeypatch.setattr(session, "HELD_S", 0.02)
    live.apply(messages.SetMotion(ahead=1.0))
    time.sleep(0.03)
    while not _next(live).is_fine:
        pass


def test_changes_of_a_camera_are_undone_and_done_again(live):
    for k in (3.0, 4.0, 5.0):  # a slider that moves: one step
        live.apply(messages.SetValue(path="sensor.mirror.k", value=k))
        live.accept(_next(live).state.document)
    live.apply(messages.SetValue(path="sensor.mirror.c", value=2.0))
    live.accept(_next(live).state.document)
    assert live.history == (2, 0)
    live.apply(messages.Undo())
    assert live.state.document.sensor == {"mirror": {"k": 5.0}}
    live.apply(messages.Undo())
    assert live.state.document == CameraDocument()
    live.apply(messages.Undo())  # nothing is left
    assert live.history == (0, 2)
    live.apply(messages.Redo())
    live.apply(messages.Redo())
    assert live.state.document.sensor == {"mirror": {"k": 5.0, "c": 2.0}}


def test_a_camera_that_cannot_be_is_taken_back(live):
    live.accept(_next(live).state.document)
    live.apply(messages.SetValue(path="sensor.mirror.k", value=1.0))
    live.reject(_next(live).state.document)
    assert live.state.document == CameraDocument()
    assert live.history == (0, 0)


@pytest.mark.parametrize("model", CAMERA_MODELS)
def test_every_entry_of_the_menus_of_models_is_a_camera_also_behind_its_surfaces(live, model):
    live.apply(messages.Preset(kind="lens", name="eucm"))
    live.apply(messages.SetValue(path="sensor.lens.model", value=model))
    assert live.state.document.camera().model.model_name == model
    if model == "hyperbolic":  # has surfaces of its own
        return
    live.apply(messages.Preset(kind="optics", name="sphere"))
    live.apply(messages.SetValue(path="sensor.optics.camera.tilt_deg", value=[1.0, 2.0, 0.0]))
    before = live.state.document
    live.apply(messages.SetValue(path="sensor.optics.camera.model", value=model))
    optics = live.state.document.value("sensor.optics")
    assert (optics["camera"]["model"], optics["camera"]["tilt_deg"]) == (model, [1.0, 2.0, 0.0])
    assert optics["surfaces"] == before.value("sensor.optics.surfaces")
    live.state.document.camera()


def test_back_to_start_restores_the_pose_the_time_and_the_direction(live):
    start = live.state
    live.apply(messages.SetPlace(x=3.0, y=-1.0, z=2.0, yaw_deg=50.0))
    live.apply(messages.Clock(running=False, time_s=4.0))
    live.apply(messages.Gaze(yaw_deg=40.0, pitch_deg=0.0))
    live.apply(messages.SetValue(path="sensor.mirror.k", value=3.0))
    live.apply(messages.ToStart())
    state = live.state
    assert (state.place, state.time_s, state.gaze) == (start.place, start.time_s, start.gaze)
    assert state.document.value("sensor.mirror.k") == 3.0


def test_an_impossible_message_changes_nothing(live):
    before = live.state
    for message in (
        messages.SetValue(path="size_px", value=100_000),
        messages.SetValue(path="sensor.lens.model", value="none"),
        messages.SetValue(path="sensor.lens.model"),
        messages.SetValue(path="sensor.optics.camera.model", value=["eucm"]),
        messages.Preset(kind="lens", name="none"),
        messages.SetViews(names=("nothing",)),
        messages.Replay(step=3),
    ):
        with pytest.raises(OmnisimError):
            live.apply(message)
    assert live.state == before


def test_places_are_rounded_to_what_a_command_line_repeats(live):
    live.apply(messages.SetPlace(x=1 / 3, y=-2e-9, z=1.0, yaw_deg=725.12345))
    assert live.state.place == Place((0.3333, 0.0, 1.0), 5.123)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rubbish", "expected JSON"),
        (b"\x00", "expected JSON, got bytes"),
        ("[" * 100_000, "expected JSON"),
        ("[]", "type = None: expected one of ask"),
        ('{"type": "jump"}', "type = 'jump': expected one of ask"),
        ('{"type": ["ask"]}', r"type = \['ask'\]: expected one of ask"),
        ('{"type": "drive", "ahead": 2}', "drive.ahead: expected a number ≤ 1, got 2"),
        ('{"type": "drive", "ahead": NaN}', r"drive\.ahead: expected"),
        ('{"type": "go", "x": 1e9, "y": 0}', "go.x: expected a number ≤ 100000"),
        ('{"type": "go"}', "go.x: missing"),
        ('{"type": "ask", "more": 1}', "ask.more: unknown key"),
        ('{"type": "save", "what": "all"}', r"save\.what: "),
    ],
)
def test_a_message_that_cannot_be_is_refused_in_words(text, words):
    with pytest.raises(OutputError, match=words):
        messages.parse_message(text)
