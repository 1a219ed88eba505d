"""Faults of the data, which are checked before any physics: units, signs, frames and
permutations; and warnings about a campaign."""
