"""Formats of exported runs, one module each."""
