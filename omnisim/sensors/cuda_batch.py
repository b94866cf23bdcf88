"""Batches that stay on the GPU, for CUDA. Experimental: run on no GPU yet."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

from omnisim.errors import GraphicsError
from omnisim.gpu.cuda_buffer import CudaBuffer
from omnisim.gpu.pipeline import ScenePoses
from omnisim.sensors.backend import CameraBackend
from omnisim.sensors.cube_backend import CubeCamera
from omnisim.sensors.stage import Closing


class CudaBatch(Closing):
    """Batches of one renderer and one size in memory of CUDA, see `Renderer.cuda_batch`.

    Args:
        count: of the pictures.
        current: makes the renderer's context current, and gives its passes.
        poses_of: states.
        device: CUDA's number of the same GPU.

    Raises:
        GraphicsError: no GPU of NVIDIA, or a camera whose pictures are made one after the other.
        OmnisimError: the extra `cuda` is not installed.
    """

    def __init__(
        self,
        count: int,
        current: Callable[[], AbstractContextManager[CameraBackend]],
        poses_of: Callable[[object], list[ScenePoses]],
        device: int,
    ):
        self._count, self._current, self._poses_of = count, current, poses_of
        with current() as passes:
            if not isinstance(passes, CubeCamera) or passes.batches is None:
                raise GraphicsError("cuda_batch: expected an ideal camera of back end 'cube'")
            width, height = passes.batches.size_px
            shape = (count, height, width, 3)
            self._buffer: CudaBuffer | None = CudaBuffer(passes.batches.context, shape, device)

    def render(self, states: object) -> CudaBuffer:
        """Render pictures (count, height, width, 3) uint8, sRGB, valid until the next ones.

        Raises:
            GraphicsError: another number of states, or it is closed.
            OmnisimError: one that is not a pose.
        """
        poses, buffer = self._poses_of(states), self._buffer
        if buffer is None:
            raise GraphicsError("this batch is closed: make a new one")
        if len(poses) != self._count:
            raise GraphicsError(f"states: expected {self._count}, got {len(poses)}")
        with self._current() as passes:
            buffer.begin()
            if isinstance(passes, CubeCamera) and passes.batches is not None:
                passes.batches.copy_to(buffer.buffer, poses)
            buffer.end()
        return buffer

    def close(self) -> None:
        """Free the memory; a second time does nothing. The renderer has to be open."""
        if self._buffer is not None:
            with self._current():
                self._buffer.close()
            self._buffer = None
