"""Validation: errors on held-out poses with their intervals, and extrapolation.

Imports `fitting` and `campaigns`.
"""
