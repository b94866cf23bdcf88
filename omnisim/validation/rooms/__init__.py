"""Test rooms of the checks."""
