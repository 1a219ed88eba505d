"""The model of a campaign and its fit by generalized least squares with priors.

Also: noise of the measurements, and registration of frames and targets. Imports
`campaigns`, `effects` and what these import; knows nothing of hypotheses.
"""
