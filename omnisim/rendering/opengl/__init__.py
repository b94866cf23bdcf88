"""OpenGL (the only importer of moderngl): context, shaders, buffers, passes."""
