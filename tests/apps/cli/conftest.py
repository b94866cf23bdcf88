"""The command line, run in an empty folder."""

import sys

import pytest

from omnisim.apps.cli.app import main
from tests.printed_numbers import PRINTED_NOISE


@pytest.fixture(scope="module", autouse=True)
def _coarse(coarse_shadows):
    """No test of the command is about the rims of shadows."""


@pytest.fixture
def omnisim(monkeypatch, capsys, tmp_path):
    """Runs the command in an empty folder; returns exit status, standard output and error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["omnisim", *map(str, arguments)])
        status = 0
        try:
            main()
        except SystemExit as stopped:
            status = stopped.code or 0
        captured = capsys.readouterr()
        for text in (captured.out, captured.err):
            is_json = text.startswith("{")  # with all digits
            assert is_json or not PRINTED_NOISE.findall(text), text
        return status, captured.out, captured.err

    return run


@pytest.fixture
def ran(omnisim):
    """Runs a command that works; returns standard output and error."""

    def run(*arguments):
        status, out, error = omnisim(*arguments)
        assert status == 0, error
        return out, error

    return run


@pytest.fixture
def quiet(ran):
    """Runs a command that works and has no notes; returns standard output."""

    def run(*arguments):
        out, error = ran(*arguments)
        assert error == ""
        return out

    return run


@pytest.fixture
def refused(omnisim, tmp_path):
    """Runs a command that is refused in one line and writes nothing; returns the line."""

    def run(*arguments):
        before = sorted(tmp_path.rglob("*"))
        status, out, error = omnisim(*arguments)
        assert (status, out, error.count("\n")) == (1, "", 1), (arguments, error)
        assert error.startswith("error: ")
        assert sorted(tmp_path.rglob("*")) == before
        return error.removeprefix("error: ").rstrip("\n")

    return run
