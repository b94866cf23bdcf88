"""Motion in a scene: dynamic objects, keyframes, deformation."""
