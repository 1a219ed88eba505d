"""What physics leaves: regressions on the residuals of a fitted model, one module for each.

A module of this package that has a ``NAME`` is a regression of the catalogue; see `protocol`.
"""
