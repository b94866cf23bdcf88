"""Exports of recorded runs to the files and folders of other tools."""
