"""Factors of parameter covariances, whose parameters have very different units."""

import numpy as np


def factor_covariance(covariance: np.ndarray) -> np.ndarray:
    """Factor a covariance (P, P), which is singular if parameters are fixed, as L L'.

    L comes from the symmetric root of the correlation matrix: the covariance itself is
    badly scaled, as kilograms would drown radians per newton metre; and unlike the
    signs of eigenvectors, or a basis of those with equal values, this root is unique, so
    that rounding does not change the robots that are drawn with it.
    """
    # Rounding leaves a variance that is zero slightly negative.
    deviation = np.sqrt(np.diag(covariance).clip(min=0.0))
    scale = np.where(deviation > 0, deviation, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = vectors * np.sqrt(values.clip(min=0.0)) @ vectors.T
    factor: np.ndarray = deviation[:, None] * root
    return factor
