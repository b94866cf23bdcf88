"""Ray casting: images and ray hits from Embree, without a GPU.

In the order of a ray: `ray_backend` opens a scene and aims rays at a camera's samples; `ray_scene`
follows each through surfaces; `caster` finds the triangles that it hits, in the tables of
`geometry`; `shading` lights them. `cast_beams` makes scans of hits, and `scene_rays` ground truth,
also for a back end that draws.
"""
