"""The parts of `benchmarks/silent.py`."""
