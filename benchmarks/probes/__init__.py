"""Probes: small programs of our own that ask the machine for one thing alone.

What they find is the limit that a frame is held against. None of them knows the renderer, but for
`surfaces`, which lets it draw an empty room.
"""
