"""How a scene is drawn (the only importer of moderngl): context, shaders, buffers, passes."""
