"""Faults of the data, looked for before any physics: units, signs, frames,
permutations; and what a campaign is warned of.

Imports `fitting` and what that imports.
"""
