"""Motion of what is in a scene: dynamic objects, keyframes, deformation."""
