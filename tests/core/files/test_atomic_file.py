"""Files and folders that appear whole, in folders that may be missing."""

from pathlib import Path

import pytest

from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import (
    atomic_folder,
    atomic_write,
    check_new_folder,
    check_target,
    write_text,
)


def test_missing_folders_are_created(tmp_path):
    check_target(tmp_path / "a" / "b" / "c.txt")
    assert list(tmp_path.iterdir()) == []
    write_text(tmp_path / "a" / "b" / "c.txt", "c")
    assert (tmp_path / "a" / "b" / "c.txt").read_text() == "c"
    with atomic_folder(tmp_path / "d" / "e") as folder:
        (folder / "f.txt").touch()
    assert (tmp_path / "d" / "e" / "f.txt").is_file()


def test_a_failure_leaves_no_folder(tmp_path):
    (tmp_path / "old").mkdir()
    with (
        pytest.raises(OutputError, match="cannot be written"),
        atomic_write(tmp_path / "old" / "new" / "c") as file,
    ):
        file.with_name("no").joinpath("c").write_text("c")
    assert list((tmp_path / "old").iterdir()) == []


def test_a_folder_that_takes_no_files_is_refused_before_the_work():
    """Also by root, whom `os.access` allows everything."""
    with pytest.raises(OutputError, match=r"x\.txt: the folder /proc cannot be written to"):
        check_target(Path("/proc/x.txt"))
    with pytest.raises(OutputError, match="the folder /proc cannot be written to"):
        check_new_folder(Path("/proc/x"))


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").touch()
    for name in ("file/a", "file/a/b"):
        with pytest.raises(OutputError, match="file: is a file: expected a folder"):
            check_target(tmp_path / name)
