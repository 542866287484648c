"""The parts of the benchmark suite, one file each. `python -m scripts.benchmark` runs them."""
