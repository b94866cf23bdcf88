"""Live page in random use: the process's memory stays what it was, and nothing fails."""

import contextlib
import random
import struct

from omnisim.apps.live.camera_document import preset_lists
from omnisim.apps.live.controls import control_groups
from omnisim.apps.live.live_messages import VIEWS
from tests.apps.live.pages import Client, live_settings, served
from tests.soak.renderers import resident_bytes

WARM_SHARE = 0.4  # of the actions, until every camera and view has been there once
# Bytes after that, whatever was done: what a camera more or less holds at a moment.
MAX_GROWTH = 60e6


def live(times: int, seed: int, print_line=print) -> float:
    """Do `times` random things on the page, with a second page that comes and goes.

    Returns:
        Growth of the resident memory in bytes after the first `WARM_SHARE` of them.
    """
    chance = random.Random(seed)
    before = 0
    with served(live_settings("soccer")) as page, Client(page) as client:
        for number in range(1, times + 1):
            _act(client, page, chance)
            client.send("turn", yaw_deg=1.0)  # or nothing may be new
            frame = client.frame()
            assert frame["parts"], number
            if number == round(WARM_SHARE * times):
                before = resident_bytes()
            if number % max(1, times // 20) == 0:
                growth = resident_bytes() - before if before else 0
                print_line(
                    f"{number} of {times} actions: {resident_bytes() / 1e6:.0f} MB, "
                    f"{growth / 1e6:+.1f} MB"
                )
        client.send("reset")
        client.send("turn", yaw_deg=1.0)
        assert client.fine_frame()["is_fine"]
        return resident_bytes() - before


def _act(client, page, chance):
    kind = chance.choices(
        ("drive", "set", "preset", "views", "probe", "turn", "undo", "rest", "rubbish", "watch"),
        (30, 20, 5, 6, 15, 10, 4, 6, 3, 2),
    )[0]
    if kind == "drive":
        client.send("drive", ahead=chance.uniform(-1, 1), turn=chance.uniform(-1, 1))
    elif kind == "set":
        document = page.session.state.document
        with contextlib.suppress(Exception):  # a camera that cannot be: the page is told
            group = chance.choice(control_groups(document, document.camera()))
            control = chance.choice(group["controls"])
            soft = control["soft"]
            if soft is not None and control["kind"] == "number":
                value = chance.uniform(soft["low"], soft["high"])
                client.send("set", path=control["path"], value=value)
    elif kind == "preset":
        of = chance.choice(("lens", "lens", "degradation"))
        client.send("preset", kind=of, name=chance.choice(preset_lists()[of]))
    elif kind == "views":
        client.send("views", names=chance.sample(VIEWS, chance.randint(0, 4)))
    elif kind == "probe":
        view = chance.choice(("camera", "panorama", "perspective", "birdseye"))
        client.send("probe", view=view, u=chance.random(), v=chance.random(), follow=True)
    elif kind == "turn":
        client.send("turn", yaw_deg=chance.uniform(-90, 90))
    elif kind == "undo":
        client.send(chance.choice(("undo", "redo", "reset")))
    elif kind == "rest":
        client.send("drive")
        client.send("turn", yaw_deg=1.0)
        client.fine_frame()
    elif kind == "rubbish":
        client.socket.send(struct.pack("d", chance.random()))
    else:
        with Client(page) as other:
            other.send("ask")
