"""Figures of blind proof, closed loop and league: tables in, PDF out; computes
nothing."""
