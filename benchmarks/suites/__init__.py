"""The suites: a module each, with `run(rounds)`, which gives a report."""
