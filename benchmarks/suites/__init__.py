"""The suites: a module each, with `run(options)`, `lines(report)` and `plot(report, path)`."""
