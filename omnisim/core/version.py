"""Version of omnisim, recorded in files and reports."""

__version__ = "0.1.0"
