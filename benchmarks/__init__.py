"""Measurements: how fast the solvers are, how far off, and what the machine would allow.

Each of `report`, `roofline`, `speed_vs_error` and `model_choices` is a command,
``python -m benchmarks.NAME``, that writes its tables and figures anew; `bench_solvers`
holds the classes that asv runs.
"""
