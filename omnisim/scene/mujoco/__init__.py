"""MuJoCo models as scenes: geoms, materials, textures, lights and cameras.

Modules import in one direction: names and textures, materials and geometry, meshes, `model_scene`,
`reader`. All need the extra `mujoco`.
"""
