"""The scene on the GPU: its geometry, deformation, materials and textures."""
