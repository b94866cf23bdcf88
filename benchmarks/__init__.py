"""Performance of omnisim: `python -m benchmarks SUITE`. The method is in README.md."""
