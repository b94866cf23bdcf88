"""Validation: the paper's figures, and comparisons with independent oracles."""
