"""Scene files: sources, tables, search paths, and the reader of each format."""
