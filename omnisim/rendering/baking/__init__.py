"""Baked light: what static surfaces get from lamps, sky and each other, computed once.

Source of the method: Goral et al., "Modeling the interaction of light between diffuse surfaces",
1984; its last bounce is gathered anew with many rays, as in Reichert, 1992.
"""
