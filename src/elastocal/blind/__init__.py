"""The blind proof: cases with a truth that the diagnosis does not see."""
