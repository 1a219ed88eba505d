"""The model of a campaign and its fit: covariance of the measurements, registration,
generalized least squares with priors.

Imports `campaigns`, `effects` and what these import; knows nothing of hypotheses.
"""
