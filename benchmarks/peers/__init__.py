"""Peers: other renderers' methods for the same frame; README.md describes them."""
