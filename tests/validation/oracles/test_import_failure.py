"""An oracle that cannot be used says why, and what to do."""

import pytest

from omnisim.validation import oracles
from omnisim.validation.oracles import import_failure


def test_what_is_there_is_not_missing():
    assert import_failure("json") == ""
    assert import_failure("json.loads") == ""


def test_what_is_not_there():
    assert import_failure("no_such_module") == (
        "no_such_module is not installed: pip install omnisim[oracles]"
    )
    assert import_failure("json.omnidir") == (
        "json.omnidir is not in this json: pip install omnisim[oracles]"
    )


@pytest.mark.parametrize("broken", [ImportError("libatomic.so.1: no\nsuch file"), NameError("x")])
def test_what_is_broken(monkeypatch, broken):
    def import_module(name):
        raise broken

    monkeypatch.setattr(oracles, "import_module", import_module)
    message = import_failure("mitsuba")
    assert message.startswith(
        "mitsuba is installed and cannot be imported; sudo apt-get install libatomic1"
    )
    assert "\n" not in message
