"""Atlas of virtual cameras: the tiles that a camera needs, and their sampling density."""
