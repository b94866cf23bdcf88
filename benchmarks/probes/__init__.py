"""Probes: small programs that measure one rate of the machine.

What they find is the limit that a frame is held against. None of them knows the renderer, but for
`surfaces`, which lets it draw an empty room.
"""
