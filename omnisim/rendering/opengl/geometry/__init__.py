"""Geometry on the GPU: vertices, indices, instances, tables of triangles."""
