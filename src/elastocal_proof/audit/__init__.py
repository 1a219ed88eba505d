"""An audit of a finished run: samples of its files worked out again by libraries that share no code with the pipeline.

Random numbers come from numpy's Philox, poses, Jacobians and deflections from pinocchio, equilibria from MuJoCo, least squares
from statsmodels. Nothing here imports the package's own mechanics, identification, metrics or tables.
"""
