"""Exports of recorded runs to the files and folders that other tools read."""
