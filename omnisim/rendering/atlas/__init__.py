"""Plans of the atlas in NumPy, without a back end: sampling density, tiles, parts of images.

Limits of a GPU are arguments.
"""
