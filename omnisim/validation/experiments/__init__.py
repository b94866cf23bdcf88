"""Experiments of the paper's section 3.2: landmark detection and self-localization."""
