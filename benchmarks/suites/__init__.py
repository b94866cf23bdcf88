"""Suites: one module each, with `run(options)`, `lines(report)` and `figure(report)`."""
