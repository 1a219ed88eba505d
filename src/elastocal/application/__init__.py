"""What a fitted model is good for: forward model, corrected joint targets, planned
measurements, a certificate.

Imports `diagnosis` and what that imports, and `exchange`.
"""
