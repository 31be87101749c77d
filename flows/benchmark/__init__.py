"""Measure the pipeline against captures with truth; only benchmarks read truth."""
