"""Faults of the data that are looked for before any physics, one module each."""
