"""Held-out poses: how they are parted, the error on them with its interval, and which
lie outside the fitted range.

Imports `fitting` and `campaigns`.
"""
