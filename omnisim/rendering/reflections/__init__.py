"""Reflections of a scene by the back end `cube`: their kinds, and notices on them."""
