"""`omnisim export`: its errors in one line."""


def test_an_unknown_format_is_refused_with_the_nearest(omnisim):
    status, _, error = omnisim("export", "run", "--to", "ros2-mcp", "-o", "out")
    assert (status, error) == (1, "error: --to ros2-mcp: did you mean 'ros2-mcap'?\n")


def test_a_missing_extra_is_named(omnisim, monkeypatch):
    monkeypatch.setattr("omnisim.core.extras.is_installed", lambda module: False)
    status, _, error = omnisim("export", "run", "--to", "ros2-mcap", "-o", "out")
    assert status == 1
    assert error == "error: --to ros2-mcap needs rosbags: pip install 'omnisim-camera[ros]'\n"


def test_a_folder_that_is_no_run_is_refused(omnisim, tmp_path):
    (tmp_path / "empty").mkdir()
    status, _, error = omnisim("export", "empty", "--to", "ros2-mcap", "-o", "out")
    assert (status, error) == (
        1,
        "error: empty: has no manifest.json: expected the folder of a run, as drive and record "
        "make it\n",
    )
