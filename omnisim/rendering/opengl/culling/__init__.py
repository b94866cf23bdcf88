"""Culling: clusters of triangles, frustum and cone culling, hierarchical depth."""
