"""Materials of USD and their textures."""
