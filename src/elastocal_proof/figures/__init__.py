"""Figures of the blind benchmark, the closed loop and the benchmark of methods."""
