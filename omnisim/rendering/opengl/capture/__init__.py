"""Capture: from a camera's pixels to rays, to texels of the atlas, to the image."""
