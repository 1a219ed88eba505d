"""Regressions on the residuals of the physical model, and a test whether these depend
on the joint angles."""
