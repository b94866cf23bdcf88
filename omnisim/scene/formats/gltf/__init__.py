"""glTF 2.0 importer, with one module per part of the specification.

Damaged files raise a SceneError that names the location in the JSON.
"""
