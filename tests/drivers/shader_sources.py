"""Sources of the shaders that a process compiles, as OpenGL gets them."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import moderngl
import pytest

STAGES = {"vertex_shader": ".vert", "fragment_shader": ".frag"}


@contextmanager
def collected_shaders(folder: Path | None) -> Iterator[None]:
    """Write what is compiled into a folder, one file for each shader of each program; None: do
    nothing."""
    if folder is None:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    program, compute_shader = moderngl.Context.program, moderngl.Context.compute_shader

    def write(sources: dict[str, str]) -> None:
        number = hashlib.sha256("\0".join(sources.values()).encode()).hexdigest()[:16]
        for suffix, source in sources.items():
            (folder / f"{number}{suffix}").write_text(source, encoding="utf-8")

    def collecting_program(context, **stages):
        write({suffix: stages[stage] for stage, suffix in STAGES.items()})
        return program(context, **stages)

    def collecting_compute_shader(context, source):
        write({".comp": source})
        return compute_shader(context, source)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(moderngl.Context, "program", collecting_program)
        patch.setattr(moderngl.Context, "compute_shader", collecting_compute_shader)
        yield
