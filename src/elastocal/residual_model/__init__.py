"""What physics leaves: whether it is a function of the joints, and regressions on
it."""
