"""Hits of rays: pixels and lidar beams by IDs of triangles, laser beams by all triangles."""
