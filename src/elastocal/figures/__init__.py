"""Figures of the study and of the robots, as matplotlib figures that the caller saves."""
