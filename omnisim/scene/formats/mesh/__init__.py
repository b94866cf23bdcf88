"""Meshes by trimesh: OBJ, PLY, STL, COLLADA and others."""
