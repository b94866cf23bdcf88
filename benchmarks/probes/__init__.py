"""Probes: small programs that measure single rates of the machine.

The rates are the limit with which a frame is compared. Probes do not depend on the renderer, except
`surfaces`, which renders an empty room with it.
"""
