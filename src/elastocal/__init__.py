"""Elastostatic calibration of serial robots: the science, importable without the pipeline that runs it."""

__version__ = "0.1.0"
