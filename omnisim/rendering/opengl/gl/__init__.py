"""OpenGL: contexts, state, memory, programs and readback; the only package that calls OpenGL."""
