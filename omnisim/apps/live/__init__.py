"""Live page: a camera in the browser, moved by keys, with a control for every parameter.

`live.py` serves the page and its stream, `session.py` holds the user input, and `engine.py`
renders in the one thread that owns OpenGL.
"""
