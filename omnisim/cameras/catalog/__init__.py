"""Catalog of measured cameras: `lenses.tsv.xz`, and its search."""
