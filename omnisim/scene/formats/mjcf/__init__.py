"""MuJoCo models as scenes: geoms, materials, textures, lights and cameras.

Modules import in one direction: names, textures and geometry; materials and mapping; meshes, lights
and deformables; `reader`; `moving_model`. All require the extra `mujoco`.
"""
