"""Scene formats, one folder per format.

Readers and all that they call raise a SceneError that names place, value and what was expected.
"""
