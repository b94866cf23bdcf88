"""Live page: the camera in a browser, driven by keys, with a control for every parameter.

`server.py` serves the page and its stream, `session.py` holds the user input, and `engine.py`
renders in the one thread that owns OpenGL.
"""
