"""Live page: the camera in a browser, driven by keys, with every parameter as a control.

`server.py` serves the page and its stream, `session.py` keeps the wishes of those who drive,
`engine.py` draws them in the one thread that owns OpenGL.
"""
