"""Faults of the data, looked for before any physics: units, signs, frames, permutations; one module for each kind.

A module with NAMES is looked for: see `protocol`. Imports `fitting` and what that imports.
"""
