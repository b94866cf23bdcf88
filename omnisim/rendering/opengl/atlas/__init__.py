"""The atlas of virtual cameras: which tiles a camera needs, and how finely sampled."""
