"""Scene sources: files, tables, search paths and the registry of format readers."""
