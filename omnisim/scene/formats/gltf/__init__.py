"""glTF 2.0, read directly: one module for each part of the specification.

Damaged files raise a SceneError that names the place in the JSON.
"""
