"""omnisim: pictures from omnidirectional cameras that can be trusted."""

__version__ = "0.1.0"
