"""Drawing of the scene: buffers on the GPU, surface programs, the cube pass."""
