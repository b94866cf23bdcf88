"""The chapters of the proof, one module each, in the order of the report."""
