"""Tar files that depend only on their members: no times, no owners, sorted by name."""

from __future__ import annotations

import hashlib
import tarfile
from pathlib import Path

from omnisim.core.files.atomic_file import atomic_write


def write_tar(path: Path, folder: Path) -> tuple[str, int]:
    """Write all files of a folder to a tar, atomically.

    Returns:
        SHA-256 of the tar, hexadecimal, and its size in bytes.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_write(path) as partial:
        with tarfile.open(partial, "w", format=tarfile.USTAR_FORMAT) as tar:
            for file in sorted(folder.iterdir()):
                member = tarfile.TarInfo(file.name)
                member.size, member.mode = file.stat().st_size, 0o644
                with file.open("rb") as content:
                    tar.addfile(member, content)
        return file_sha256(partial), partial.stat().st_size


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
