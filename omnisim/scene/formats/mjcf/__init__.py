"""MuJoCo models as scenes: geoms, materials, textures, lights and cameras."""
