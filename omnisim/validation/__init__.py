"""Validation: the paper's figures reproduced, and comparisons with independent oracles."""
