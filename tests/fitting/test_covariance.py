"""Factors of covariances whose parameters have very different units."""

import numpy as np

from elastocal.fitting.covariance import factor_covariance


def test_factor_of_a_covariance_does_not_depend_on_the_choice_of_eigenvectors():
    """Equal eigenvalues, which rounding splits along any directions."""
    deviation = np.array([1e-4, 5.0, 0.0, 2e-3])
    covariance = np.diag(deviation**2)
    rounding = np.random.default_rng(1).standard_normal((4, 4)) * 1e-15
    disturbed = covariance + np.outer(deviation, deviation) * (rounding + rounding.T)
    factor = factor_covariance(covariance)
    np.testing.assert_allclose(factor @ factor.T, covariance, atol=1e-15)
    np.testing.assert_allclose(factor_covariance(disturbed), factor, atol=1e-12)


def test_small_units_are_not_lost_beside_large_ones():
    """A kilogram and a compliance of 1e-7 rad/(N m), correlated."""
    deviation = np.array([30.0, 1e-7])
    correlation = np.array([[1.0, 0.9], [0.9, 1.0]])
    factor = factor_covariance(correlation * np.outer(deviation, deviation))
    scaled = factor / deviation[:, None]
    np.testing.assert_allclose(scaled @ scaled.T, correlation, rtol=1e-12)


def test_a_variance_that_rounding_has_made_negative_counts_as_zero():
    """As of a direction whose share of the covariance has been subtracted."""
    factor = factor_covariance(np.diag([1e-8, -1e-21]))
    np.testing.assert_allclose(factor, np.diag([1e-4, 0.0]), atol=1e-18)
