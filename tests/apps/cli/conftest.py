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
