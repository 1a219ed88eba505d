"""An audit of a finished run: samples of every file recomputed by libraries that share no code with the pipeline.

Poses, Jacobians and deflections come from pinocchio and MuJoCo, least squares from statsmodels, intervals from scipy. Nothing
here imports the package's own mechanics, identification, metrics or tables.
"""
