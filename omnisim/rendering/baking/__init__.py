"""Baked light: light on static surfaces from lamps, sky and each other, computed once.

Source of the method: Goral et al., "Modeling the interaction of light between diffuse surfaces",
1984; the last bounce is a final gathering with many rays, as in Reichert, 1992.
"""
