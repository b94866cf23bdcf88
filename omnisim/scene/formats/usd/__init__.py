"""USD importer (the only user of usd-core), with one module per part of the schemas.

Stages are read in a separate process, see `reader.py`. This isolates usd-core's console output and
its crashes on damaged files.
"""
