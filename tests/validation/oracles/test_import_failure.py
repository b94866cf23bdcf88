"""An oracle that cannot be used says why, and what to do."""

import pytest

from omnisim.validation import oracles
from omnisim.validation.oracles import import_failure


def test_installed_modules_have_no_failure():
    assert import_failure("json") == ""
    assert import_failure("json.loads") == ""


def test_missing_modules_name_their_extra():
    assert import_failure("no_such_module") == (
        "no_such_module is not installed: pip install 'omnisim-camera[oracles]'"
    )
    assert import_failure("json.omnidir") == (
        "json.omnidir is not in this json: pip install 'omnisim-camera[oracles]'"
    )


@pytest.mark.parametrize("broken", [ImportError("libatomic.so.1: no\nsuch file"), NameError("x")])
def test_broken_modules_name_their_error(monkeypatch, broken):
    def import_module(name):
        raise broken

    monkeypatch.setattr(oracles, "import_module", import_module)
    message = import_failure("mitsuba")
    assert message.startswith(
        "mitsuba is installed and cannot be imported; sudo apt-get install libatomic1"
    )
    assert "\n" not in message
