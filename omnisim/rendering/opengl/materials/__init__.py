"""Materials on the GPU: tables and textures."""
