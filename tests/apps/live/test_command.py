"""`omnisim live`: what cannot be is one line, a film is a film, and Ctrl-C ends it."""

import os
import signal
import subprocess
import sys

import pytest

from omnisim.apps.cli.app import main


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("nowhere", "nowhere"),
        ("rings --robot p2at --sensor a.toml", "a.toml: "),
        ("rings --sensor a.toml --optics b.toml", "--sensor, --optics: expected one of them, got"),
        ("rings --mirrored", "--mirrored: requires --camera"),
        ("rings --size 5000", "size_px: expected 16 to 2048 px, got 5000"),
        ("--run nowhere", "nowhere: no such folder: expected the folder of a run"),
        ("--run nowhere --at 0 0 1", "--at: expected none with --run"),
        ("--run nowhere --sky clear", "--sky: expected none with --run"),
        ("--run nowhere --unlit", "--unlit: expected none with --run"),
        ("rings --robot p2at --pitch 3", "--pitch: expected none with --robot"),
        ("rings --sky none.hdr", "none.hdr"),
        ("rings --record film.gif", "film.gif: expected .mp4 or .mkv, got .gif"),
        ("rings --host 203.0.113.7", "cannot listen on 203.0.113.7"),
    ],
)
def test_bad_input_is_one_line(words, line, capsys, monkeypatch, tmp_path, needs_opengl):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(sys, "argv", ["omnisim", "live", *words.split()])
    with pytest.raises(SystemExit) as stopped:
        main()
    errors = capsys.readouterr().err
    assert stopped.value.code == 1
    assert errors.count("\n") == 1
    assert line in errors


@pytest.mark.slow
def test_a_film_is_recorded_without_a_page(tmp_path, monkeypatch, needs_opengl):
    from omnisim.apps.live import live_source as record

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(record, "SECONDS", 0.2)
    monkeypatch.setattr(
        sys, "argv", ["omnisim", "live", "rings", "--size", "48", "--record", "film.mp4"]
    )
    with pytest.raises(SystemExit) as stopped:
        main()
    assert not stopped.value.code
    assert (tmp_path / "film.mp4").stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_at_once(number, tmp_path, needs_opengl):
    command = [sys.executable, "-m", "omnisim", "live", "rings", "--size", "64", "--port", "0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        env=os.environ | {"COLUMNS": "200"},
    ) as process:  # fmt: skip
        assert process.stdout.readline().startswith("Open http://localhost:")
        process.send_signal(number)
        out, errors = process.communicate(timeout=120)
    assert (process.returncode, out, errors) == (0, "stopped\n", "")
