"""Plans of the atlas in NumPy: sampling density, tiles of virtual cameras, and parts of images."""
