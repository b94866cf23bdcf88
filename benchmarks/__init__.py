"""How fast omnisim is: `python -m benchmarks SUITE`. The method is in README.md."""
