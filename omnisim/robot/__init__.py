"""The robot: where it goes, how it drives there, and what its wheels report.

Poses are world_from_base (`omnisim.frames`); turns and headings count counter-clockwise, seen from
above. Nothing here knows of pictures or of the GPU.
"""
