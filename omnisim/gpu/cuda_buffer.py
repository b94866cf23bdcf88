"""Pictures in memory of the GPU that CUDA takes without a copy. Experimental: run on no GPU yet.

Written to the documentation of NVIDIA's `cuda.core`: a buffer of OpenGL is registered once, and
mapped for CUDA after each batch. Mapping makes CUDA's work wait for what OpenGL does before.
"""

from __future__ import annotations

from typing import Any

import moderngl

from omnisim.errors import GraphicsError
from omnisim.extras import require_extra
from omnisim.gpu.memory import gpu_allocation

_FEATURE = "pictures in CUDA's memory"


class CudaBuffer:
    """Array (n, height, width, components) uint8 that OpenGL writes and CUDA reads.

    `torch.as_tensor(buffer, device="cuda")` and `cupy.asarray(buffer)` copy nothing; what they
    return is valid until the next batch.

    Args:
        context: current, on NVIDIA's driver, also in the methods.
        shape: of the array.
        device: CUDA's number of the same GPU.

    Attributes:
        shape: as given.

    Raises:
        GraphicsError: another driver, no memory, or a CUDA that refuses it.
        OmnisimError: the extra `cuda` is not installed.
    """

    def __init__(
        self, context: moderngl.Context, shape: tuple[int, int, int, int], device: int = 0
    ):
        check_cuda(context)
        from cuda.core import Device, GraphicsResource

        n, height, width, components = self.shape = shape
        with gpu_allocation(f"a batch of {n} pictures", "render fewer at once"):
            self.buffer = context.buffer(reserve=n * height * width * components)
        try:
            cuda = Device(device)
            cuda.set_current()
            self._stream = cuda.create_stream()
            self._resource = GraphicsResource.from_gl_buffer(self.buffer.glo)
        except Exception as reason:  # CUDA's errors have no common base that is documented
            raise GraphicsError(f"{_FEATURE}: CUDA device {device}: {reason}") from None
        self._pointer: int | None = None

    def begin(self) -> None:
        """Give the buffer to OpenGL."""
        if self._pointer is not None:
            self._resource.unmap(stream=self._stream)
            self._pointer = None

    def end(self) -> None:
        """Give the buffer to CUDA, and wait for OpenGL."""
        self._pointer = int(self._resource.map(stream=self._stream).handle)
        self._stream.sync()

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        """CUDA Array Interface, version 3; torch takes none that is read-only."""
        if self._pointer is None:
            raise GraphicsError(f"{_FEATURE}: expected a finished batch, got none")
        return {"shape": self.shape, "typestr": "|u1", "data": (self._pointer, False), "version": 3}

    def close(self) -> None:
        """Unregister it, with its OpenGL context current."""
        self._pointer = None
        self._resource.close()


def check_cuda(context: moderngl.Context) -> None:
    """Refuse a context whose buffers CUDA cannot take.

    Raises:
        GraphicsError: another driver than NVIDIA's.
        OmnisimError: the extra `cuda` is not installed.
    """
    vendor = context.info["GL_VENDOR"]
    if "NVIDIA" not in vendor:
        raise GraphicsError(f"{_FEATURE}: expected OpenGL of NVIDIA, got {vendor}")
    require_extra("cuda", _FEATURE)
