"""Health of the graphics card: a new process draws and reads a few pixels within seconds."""

import time

from omnisim.rendering.opengl.gl.context import open_context

MAX_S = 5.0  # a card with a fault lets every process wait 15 s


def main() -> None:
    """Fail if a pixel is wrong or late."""
    start_s = time.monotonic()
    context = open_context()
    target = context.framebuffer([context.renderbuffer((16, 16))])
    target.use()
    for level in (0, 51, 204):
        target.clear(level / 255.0, 0.0, 0.0, 1.0)
        pixels = target.read(components=1)
        assert pixels == bytes([level]) * 256, f"expected {level}, got {pixels[0]}"
    elapsed_s = time.monotonic() - start_s
    assert elapsed_s < MAX_S, f"{elapsed_s:.1f} s for three reads"
    print(f"healthy after {elapsed_s:.2f} s")


if __name__ == "__main__":
    main()
