"""Mesh formats read by trimesh: OBJ, PLY, STL, COLLADA and others."""
