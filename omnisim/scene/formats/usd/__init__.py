"""USD stages (the only importer of usd-core): one module for each part of the schemas.

They are read in a process of their own, `process.py`: what usd-core writes to the console, and a
damaged file that makes it crash, do not reach ours.
"""
