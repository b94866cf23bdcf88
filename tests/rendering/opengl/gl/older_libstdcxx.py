"""A libstdc++ as conda's older ones: without the newest symbols, which Mesa's LLVM needs."""

from pathlib import Path

from omnisim.rendering.opengl.gl import diagnosis


def make_older_libstdcxx(folder: Path) -> Path:
    """Copy the system's libstdc++ into a folder, without its version GLIBCXX_3.4.30."""
    libraries = (Path(one, "libstdc++.so.6") for one in diagnosis._LIBRARY_FOLDERS)
    system = next(path for path in libraries if path.exists())
    older = folder / system.name
    older.write_bytes(system.read_bytes().replace(b"\0GLIBCXX_3.4.30\0", b"\0GLIBCXX_3.4.3X\0"))
    return older
